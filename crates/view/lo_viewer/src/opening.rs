//! Opening scenes: from a file, or estimated from a photo.

use std::sync::Arc;

use lightoctree::{
    DepthSource, Document, Estimate, EstimateOptions, Estimator, Event, OnEvent, PanoramaPrior, PhotoRequest,
    ResolvedPhoto,
};
#[cfg(feature = "depth-models")]
use lo_depth_models::DepthModel;
use lo_geometry::Camera;
use lo_imaging as imaging;
use lo_session::OpenScene;

use crate::warning_text::WarningText;

/// Creates the estimator, called when a photo is opened.
pub type MakeEstimator = Arc<dyn Fn() -> Result<Estimator, String> + Send + Sync>;

/// Reads a depth model, called when its photo is estimated.
#[cfg(feature = "depth-models")]
pub type ReadDepthModel = Box<dyn FnOnce() -> Result<DepthModel, String> + Send>;

/// Source of a scene.
pub enum SceneSource {
    /// A scene file.
    Scene {
        /// Path on the command line.
        file: String,
        /// Content of the file.
        bytes: Vec<u8>,
        /// Whether the file exists under this path for the command line.
        is_saved: bool,
    },
    /// A photo to estimate.
    Photo(PhotoSource),
}

/// A photo with further inputs.
pub struct PhotoSource {
    /// Name and content of the photo.
    pub photo: NamedFile,
    /// Measured depth of the same view.
    pub depth: Option<NamedFile>,
    /// Name and reader of a depth model, used without measured depth.
    #[cfg(feature = "depth-models")]
    pub depth_model: Option<(String, ReadDepthModel)>,
    /// A panorama of the room.
    pub panorama: Option<NamedFile>,
    /// Focal lengths and principal point (fx, fy, cx, cy), pixels of the photo.
    pub intrinsics: Option<[f64; 4]>,
    /// Creates the estimator.
    pub estimator: MakeEstimator,
}

/// A file in memory.
pub struct NamedFile {
    /// Name without folders.
    pub name: String,
    /// Content.
    pub bytes: Vec<u8>,
}

/// An opened scene with the warnings of its estimation.
pub(crate) struct Opened {
    pub scene: OpenScene,
    pub notes: Vec<String>,
}

impl SceneSource {
    /// Returns the file name for messages.
    pub(crate) fn file(&self) -> String {
        match self {
            Self::Scene { file, .. } => file.clone(),
            Self::Photo(source) => source.photo.name.clone(),
        }
    }

    pub(crate) fn open(self, warning_text: WarningText, on_event: OnEvent<'_>) -> Result<Opened, String> {
        let mut notes = Vec::new();
        let (document, file, is_saved) = match self {
            Self::Scene { file, bytes, is_saved } => {
                let document = Document::from_bytes(&bytes).map_err(|error| format!("{file}: {error}"))?;
                (document, file, is_saved)
            }
            Self::Photo(source) => {
                let collect_warnings = &mut |event: Event| {
                    if let Event::Warning(warning) = &event {
                        notes.push(warning_text(&**warning, &[]));
                    }
                    on_event(event)
                };
                let file = scene_name(&source.photo.name);
                (estimate(source, collect_warnings)?.into(), file, false)
            }
        };
        let scene = OpenScene::new(file, document);
        let scene = if is_saved { scene } else { scene.unsaved() };
        notes.extend(scene.fitted.default_light().report().fit.warning().map(|warning| warning_text(&warning, &[])));
        Ok(Opened { scene, notes })
    }
}

/// Returns the file name of a photo's scene that is not saved yet.
fn scene_name(photo: &str) -> String {
    let stem = photo.rsplit_once('.').map_or(photo, |(stem, _)| stem);
    format!("{}.scene", if stem.is_empty() { "room" } else { stem })
}

fn estimate(source: PhotoSource, on_event: OnEvent<'_>) -> Result<Estimate, String> {
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
            DepthSource::Model(Arc::new(read()?))
        }
        None => DepthSource::Network,
        Some(depth) => {
            let depth_m = imaging::depth_from_bytes(&depth.bytes, &depth.name, None).map_err(|e| e.to_string())?;
            with = format!(" and {}", depth.name);
            sources.push(depth.name);
            DepthSource::Measured(depth_m)
        }
    };
    let ResolvedPhoto { input, camera_source, distorted, .. } = estimator
        .resolve(PhotoRequest { photo, camera, distortion: None, depth }, on_event)
        .map_err(|error| format!("{name}{with}: {error}"))?;
    let panorama = panorama
        .map(|NamedFile { name, bytes }| {
            sources.push(name.clone());
            PanoramaPrior::from_bytes(&bytes, lo_geometry::Orientation::Lightoctree, &name)
                .map_err(|error| format!("{name} is not a panorama of a room: {error}"))
        })
        .transpose()?;
    let options = EstimateOptions { sources, panorama, camera_source, distorted, ..EstimateOptions::default() };
    estimator.estimate(input, &options, on_event).map_err(|error| format!("{name}: {error}"))
}
