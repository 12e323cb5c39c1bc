use std::path::Path;

use crate::published::{CropModel, Frames, FutureHouse, InteriorNet, LavalVarying, Panoramas};
use crate::{Dataset, DatasetError, Shards};

/// How a folder's files are laid out.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Layout {
    /// [`Shards`].
    Shards,
    /// [`FutureHouse`].
    FutureHouse,
    /// [`InteriorNet`].
    InteriorNet,
    /// [`LavalVarying`].
    LavalVarying,
    /// [`Panoramas`].
    Panoramas,
    /// [`Frames`].
    Frames,
}

impl Layout {
    /// All of them, in the order in which they are tried.
    pub const ALL: [Self; 6] =
        [Self::Frames, Self::Shards, Self::FutureHouse, Self::InteriorNet, Self::LavalVarying, Self::Panoramas];

    /// Its name on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::Shards => "shards",
            Self::FutureHouse => "futurehouse",
            Self::InteriorNet => "interiornet",
            Self::LavalVarying => "laval-varying",
            Self::Panoramas => "panoramas",
            Self::Frames => "frames",
        }
    }

    /// The layout that a folder (or a single `.tar` or `.json`) has.
    ///
    /// # Errors
    /// A folder that cannot be read or is none of them.
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
        } else if InteriorNet::is_at(path) {
            Ok(Self::InteriorNet)
        } else if LavalVarying::is_at(path) {
            Ok(Self::LavalVarying)
        } else if any(&["hdr", "exr", "pfm"]) {
            Ok(Self::Panoramas)
        } else {
            let names = Self::ALL.map(Self::name).join(", ");
            Err(DatasetError::layout(path, format!("none of the layouts that are known ({names})")))
        }
    }

    /// Opens a dataset; `model` says how photos are made of HDR pictures where the layout has no LDR ones.
    ///
    /// # Errors
    /// See the layouts.
    pub fn open(self, path: &Path, model: CropModel) -> Result<Box<dyn Dataset>, DatasetError> {
        Ok(match self {
            Self::Shards => Box::new(Shards::open(path)?),
            Self::FutureHouse => Box::new(FutureHouse::open(path, model)?),
            Self::InteriorNet => Box::new(InteriorNet::open(path, model.seed)?),
            Self::LavalVarying => Box::new(LavalVarying::open(path, model.photo, model.seed)?),
            Self::Panoramas => Box::new(Panoramas::open(path, model)?),
            Self::Frames => Box::new(Frames::open(path)?),
        })
    }

    /// Opens panoramas with the plans of a folder ([`Panoramas::with_plans`]), where one is given; else as [`Layout::open`].
    ///
    /// # Errors
    /// Of both; plans where there are no panoramas.
    pub fn open_planned(
        self,
        path: &Path,
        model: CropModel,
        plans: Option<&Path>,
    ) -> Result<Box<dyn Dataset>, DatasetError> {
        match (self, plans) {
            (_, None) => self.open(path, model),
            (Self::Panoramas, Some(plans)) => Ok(Box::new(Panoramas::open(path, model)?.with_plans(plans)?)),
            (other, Some(_)) => {
                let reason = format!("plans are of panoramas, and its layout is {}", other.name());
                Err(DatasetError::layout(path, reason))
            }
        }
    }
}
