use std::path::PathBuf;
use std::time::Duration;

use serde::Serialize;

/// What a run says on its way; every front end consumes the same stream.
#[derive(Clone, Debug)]
pub enum Message {
    /// A phase begins or goes on.
    Phase {
        /// "depth", "light 2/3" …
        name: String,
        /// Its steps.
        steps: u64,
        /// Those that are done.
        done: u64,
    },
    /// A step is done.
    Step {
        /// Steps of the phase that are done.
        done: u64,
        /// Loss by loss, mean since the last line of the log.
        losses: Vec<(&'static str, f32)>,
    },
    /// Figures on held-out scenes.
    Validation(ValidationReport),
    /// A checkpoint and the weights were written.
    Saved {
        /// The checkpoint.
        path: PathBuf,
        /// How long that took.
        took: Duration,
    },
    /// Something that the user should know.
    Note(String),
}

/// Means over held-out scenes. PSNR: of panoramas from novel places, sRGB-coded and clipped to the photo's white, all pixels alike; mean over
/// panoramas. What does not apply is missing.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct ValidationReport {
    /// Photos, each of another scene.
    pub photos: usize,
    /// Mean of |predicted − true| / true depth.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub depth_abs_rel: Option<f32>,
    /// Share of the pixels whose predicted depth is within a factor of 1.25.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub depth_delta1: Option<f32>,
    /// PSNR of the global lighting decoder's panorama at the camera.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub global_psnr_db: Option<f32>,
    /// PSNR with true depth.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub psnr_db: Option<f32>,
    /// PSNR from the photo alone, in the scale of its predicted depth.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub photo_alone_psnr_db: Option<f32>,
    /// PSNR of the true octree of the same depth in the same cube: the bound.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub true_octree_psnr_db: Option<f32>,
    /// PSNR of the completion `shell` with true depth: what has to be beaten.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub shell_psnr_db: Option<f32>,
    /// Share of the nodes that are rightly taken for occupied or empty, along the true octree.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub split_accuracy: Option<f32>,
}
