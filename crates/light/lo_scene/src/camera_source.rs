use std::fmt;

use serde::{Deserialize, Serialize};

/// Where the intrinsics of a photo's camera come from.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case", tag = "from")]
pub enum CameraSource {
    /// The photo's EXIF block states the focal length.
    Exif,
    /// A depth model told the field of view from the photo.
    DepthModel,
    /// The own network told the field of view from the photo.
    Network {
        /// How far off it is expected to be, along the photo's longer side, degrees.
        deviation_deg: f32,
    },
    /// Nothing is known; a usual field of view is assumed.
    Default,
}

impl CameraSource {
    /// Whether its numbers can be meant.
    pub(crate) fn is_valid(&self) -> bool {
        match self {
            Self::Network { deviation_deg } => is_deviation(*deviation_deg),
            Self::Exif | Self::DepthModel | Self::Default => true,
        }
    }
}

/// Whether an angle is finite and not negative.
pub(crate) fn is_deviation(deg: f32) -> bool {
    deg.is_finite() && deg >= 0.0
}

impl fmt::Display for CameraSource {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        const ELSE: &str = "give --intrinsics or --hfov-deg if you know better";
        match self {
            Self::Exif => f.write_str("focal length from EXIF"),
            Self::DepthModel => write!(f, "told by the depth model; {ELSE}"),
            Self::Network { deviation_deg } => write!(f, "guessed from the photo, ± {deviation_deg:.0}; {ELSE}"),
            Self::Default => write!(f, "assumed: the photo has no EXIF focal length; {ELSE}"),
        }
    }
}
