//! How a scene comes to be open: from its file, or estimated from a photo.

use std::sync::Arc;

#[cfg(feature = "depth-models")]
use lightoctree::depth_models::DepthModel;
use lightoctree::geometry::Camera;
use lightoctree::imaging;
use lightoctree::{
    DepthSource, Document, Estimate, EstimateOptions, Estimator, Event, OnEvent, PanoramaPrior, PhotoRequest,
    ResolvedPhoto,
};
use lo_session::OpenScene;

use crate::EventText;

/// What the command line calls a scene that is in no file yet.
const NEW_SCENE: &str = "room.scene";

/// Makes what estimates; asked for when a photo comes.
pub type MakeEstimator = Arc<dyn Fn() -> Result<Estimator, String> + Send + Sync>;

/// Reads a depth network; done when its photo is estimated.
#[cfg(feature = "depth-models")]
pub type ReadDepthModel = Box<dyn FnOnce() -> Result<DepthModel, String> + Send>;

/// What a scene is opened from.
pub enum Source {
    /// A scene's file.
    Scene {
        /// What the command line calls it.
        file: String,
        /// Its content.
        bytes: Vec<u8>,
        /// Whether the command line finds it under this name.
        is_saved: bool,
    },
    /// A photo, to be estimated.
    Photo(PhotoSource),
}

/// A photo with what else is known of the room.
pub struct PhotoSource {
    /// The photo's name and content.
    pub photo: NamedFile,
    /// Measured depth of the same view.
    pub depth: Option<NamedFile>,
    /// Name and reader of a network that predicts depth, where none is measured.
    #[cfg(feature = "depth-models")]
    pub depth_model: Option<(String, ReadDepthModel)>,
    /// A panorama of the room.
    pub panorama: Option<NamedFile>,
    /// Focal lengths and principal point in pixels of the photo, where they are known.
    pub intrinsics: Option<[f64; 4]>,
    /// What estimates.
    pub estimator: MakeEstimator,
}

/// A file in memory.
pub struct NamedFile {
    /// Its name, without folders.
    pub name: String,
    /// Its content.
    pub bytes: Vec<u8>,
}

/// An open scene, and what was said on the way.
pub(crate) struct Opened {
    pub open: OpenScene,
    pub is_saved: bool,
    pub notes: Vec<String>,
}

impl Source {
    /// What messages call it.
    pub(crate) fn file(&self) -> String {
        match self {
            Self::Scene { file, .. } => file.clone(),
            Self::Photo(source) => source.photo.name.clone(),
        }
    }

    pub(crate) fn open(self, text: &EventText, on_event: OnEvent<'_>) -> Result<Opened, String> {
        let mut notes = Vec::new();
        let (document, file, is_saved) = match self {
            Self::Scene { file, bytes, is_saved } => {
                let document = Document::from_bytes(&bytes).map_err(|error| format!("{file}: {error}"))?;
                (document, file, is_saved)
            }
            Self::Photo(source) => {
                let hear = &mut |event: Event| {
                    if let Event::Warning(warning) = &event {
                        notes.push((text.warning)(warning, &[]));
                    }
                    on_event(event)
                };
                (estimated(source, hear)?.into(), NEW_SCENE.to_owned(), false)
            }
        };
        let open = OpenScene::new(file, document);
        notes.extend(
            open.fitted.default_light().report().fit.warning().iter().map(|warning| (text.warning)(warning, &[])),
        );
        Ok(Opened { open, is_saved, notes })
    }
}

fn estimated(source: PhotoSource, on_event: OnEvent<'_>) -> Result<Estimate, String> {
    let PhotoSource { photo: NamedFile { name, bytes }, depth, panorama, intrinsics, estimator, .. } = source;
    let photo = imaging::photo_from_bytes(&bytes, &name).map_err(|error| error.to_string())?;
    drop(bytes);
    let (width, height) = (photo.photo.width() as u32, photo.photo.height() as u32);
    let estimator = estimator()?;
    let camera = intrinsics.map(|[fx, fy, cx, cy]| Camera::new(fx, fy, cx, cy, width, height)).transpose();
    let camera = camera.map_err(|error| format!("{name}: {error}"))?;
    let mut sources = vec![name.clone()];
    let mut with = String::new();
    let depth = match depth {
        #[cfg(feature = "depth-models")]
        None if let Some((model_name, read)) = source.depth_model => {
            with = format!(" with {model_name}");
            sources.push(model_name);
            DepthSource::Model(Box::new(read()?))
        }
        None => DepthSource::Network,
        Some(depth) => {
            let depth_m = imaging::depth_from_bytes(&depth.bytes, &depth.name, None).map_err(|e| e.to_string())?;
            with = format!(" and {}", depth.name);
            sources.push(depth.name);
            DepthSource::Measured(depth_m)
        }
    };
    let ResolvedPhoto { input, camera_source, .. } = estimator
        .resolve(PhotoRequest { photo, camera, depth }, on_event)
        .map_err(|error| format!("{name}{with}: {error}"))?;
    let panorama = panorama
        .map(|NamedFile { name, bytes }| {
            sources.push(name.clone());
            PanoramaPrior::from_bytes(&bytes, lightoctree::geometry::Orientation::Lightoctree, &name)
                .map_err(|error| format!("{name} is no panorama of a room: {error}"))
        })
        .transpose()?;
    let options = EstimateOptions { sources, panorama, camera_source, ..EstimateOptions::default() };
    estimator.estimate(input, &options, on_event).map_err(|error| format!("{name}: {error}"))
}
