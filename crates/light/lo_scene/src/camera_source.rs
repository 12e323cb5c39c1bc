use std::fmt;

use serde::{Deserialize, Serialize};

/// Source of the intrinsics of a photo's camera.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case", tag = "from")]
pub enum CameraSource {
    /// The focal length in the photo's EXIF block.
    Exif,
    /// A field of view that a depth model predicted from the photo.
    DepthModel,
    /// A field of view that the camera network predicted from the photo.
    Network {
        /// Expected error along the photo's longer side, degrees.
        deviation_deg: f32,
    },
    /// No source: a typical field of view is assumed.
    Default,
}

impl CameraSource {
    /// Returns whether the values are valid.
    pub(crate) fn is_valid(&self) -> bool {
        match self {
            Self::Network { deviation_deg } => is_deviation(*deviation_deg),
            Self::Exif | Self::DepthModel | Self::Default => true,
        }
    }
}

/// Returns whether an angular error is from 0 to 360 degrees.
pub(crate) fn is_deviation(deg: f32) -> bool {
    (0.0..=360.0).contains(&deg)
}

impl fmt::Display for CameraSource {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        const ELSE: &str = "set --intrinsics or --hfov-deg if known";
        match self {
            Self::Exif => f.write_str("focal length from EXIF"),
            Self::DepthModel => write!(f, "predicted by the depth model; {ELSE}"),
            Self::Network { deviation_deg } => write!(f, "predicted from the photo, ± {deviation_deg:.0}; {ELSE}"),
            Self::Default => write!(f, "default: the photo has no EXIF focal length; {ELSE}"),
        }
    }
}
