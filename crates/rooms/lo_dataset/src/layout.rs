use std::path::Path;

use crate::published::{
    CropModel, Frames, FutureHouse, Hypersim, InteriorNet, InteriorVerse, LavalVarying, Lighthouse, Panoramas,
};
use crate::{Dataset, DatasetError, Shards};

/// File layout of a dataset.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DatasetLayout {
    /// [`Shards`].
    Shards,
    /// [`FutureHouse`].
    FutureHouse,
    /// [`Hypersim`].
    Hypersim,
    /// [`InteriorNet`].
    InteriorNet,
    /// [`InteriorVerse`].
    InteriorVerse,
    /// [`Lighthouse`].
    Lighthouse,
    /// [`LavalVarying`].
    LavalVarying,
    /// [`Panoramas`].
    Panoramas,
    /// [`Frames`].
    Frames,
}

impl DatasetLayout {
    /// All layouts, in the order of detection.
    pub const ALL: [Self; 9] = [
        Self::Frames,
        Self::Shards,
        Self::FutureHouse,
        Self::Lighthouse,
        Self::InteriorNet,
        Self::InteriorVerse,
        Self::Hypersim,
        Self::LavalVarying,
        Self::Panoramas,
    ];

    /// Returns its name on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::Shards => "shards",
            Self::FutureHouse => "futurehouse",
            Self::Hypersim => "hypersim",
            Self::InteriorNet => "interiornet",
            Self::InteriorVerse => "interiorverse",
            Self::Lighthouse => "lighthouse",
            Self::LavalVarying => "laval-varying",
            Self::Panoramas => "panoramas",
            Self::Frames => "frames",
        }
    }

    /// Detects the layout of a folder or of a single `.tar` or `.json`.
    ///
    /// # Errors
    /// If the folder cannot be read or has no known layout.
    pub fn detect(path: &Path) -> Result<Self, DatasetError> {
        if Frames::is_at(path) {
            return Ok(Self::Frames);
        }
        if path.is_file() {
            return Ok(Self::Shards);
        }
        let files = std::fs::read_dir(path).map_err(DatasetError::io(path))?;
        let mut extensions = Vec::new();
        for entry in files {
            let path = entry.map_err(DatasetError::io(path))?.path();
            extensions.extend(path.extension().map(|e| e.to_string_lossy().to_lowercase()));
        }
        let any = |known: &[&str]| extensions.iter().any(|e| known.contains(&e.as_str()));
        if any(&["tar"]) {
            Ok(Self::Shards)
        } else if FutureHouse::is_at(path) {
            Ok(Self::FutureHouse)
        } else if any(&["npz"]) {
            Ok(Self::Lighthouse)
        } else if InteriorNet::is_at(path) {
            Ok(Self::InteriorNet)
        } else if InteriorVerse::is_at(path) {
            Ok(Self::InteriorVerse)
        } else if Hypersim::is_at(path) {
            Ok(Self::Hypersim)
        } else if LavalVarying::is_at(path) {
            Ok(Self::LavalVarying)
        } else if any(&["hdr", "exr", "pfm"]) {
            Ok(Self::Panoramas)
        } else {
            let names = Self::ALL.map(Self::name).join(", ");
            Err(DatasetError::layout(path, format!("unknown dataset layout; supported are {names}")))
        }
    }

    /// Opens a dataset. `model` controls how photos are made from HDR images, for layouts without LDR photos.
    ///
    /// # Errors
    /// Errors of the layout's own `open`.
    pub fn open(self, path: &Path, model: CropModel) -> Result<Box<dyn Dataset>, DatasetError> {
        Ok(match self {
            Self::Shards => Box::new(Shards::open(path)?),
            Self::FutureHouse => Box::new(FutureHouse::open(path, model)?),
            Self::Hypersim => Box::new(Hypersim::open(path, model.photo, model.seed)?),
            Self::InteriorNet => Box::new(InteriorNet::open(path, model.seed)?),
            Self::InteriorVerse => Box::new(InteriorVerse::open(path, model.photo, model.seed)?),
            Self::Lighthouse => Box::new(Lighthouse::open(path)?),
            Self::LavalVarying => Box::new(LavalVarying::open(path, model.photo, model.seed)?),
            Self::Panoramas => Box::new(Panoramas::open(path, model)?),
            Self::Frames => Box::new(Frames::open(path)?),
        })
    }

    /// Opens panoramas with the room plans of a folder ([`Panoramas::with_plans`]). Without plans, same as
    /// [`DatasetLayout::open`].
    ///
    /// # Errors
    /// Errors of both, or plans for a layout other than panoramas.
    pub fn open_with_plans(
        self,
        path: &Path,
        model: CropModel,
        plans: Option<&Path>,
    ) -> Result<Box<dyn Dataset>, DatasetError> {
        match (self, plans) {
            (_, None) => self.open(path, model),
            (Self::Panoramas, Some(plans)) => Ok(Box::new(Panoramas::open(path, model)?.with_plans(plans)?)),
            (other, Some(_)) => {
                let reason = format!("room plans need the layout panoramas, but the layout is {}", other.name());
                Err(DatasetError::layout(path, reason))
            }
        }
    }
}
