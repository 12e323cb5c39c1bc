use std::path::PathBuf;

use lo_dataset::CropModel;
use serde::{Deserialize, Serialize};

/// A folder of panoramas and how to crop photos from them.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct PanoramaData {
    /// The folder of panoramas.
    pub folder: PathBuf,
    /// Folder of hand-drawn floor plans of the rooms. Panoramas without a plan have no depth.
    pub plans: Option<PathBuf>,
    /// Cameras of the crops. The seed is the run's.
    pub crop: CropModel,
}
