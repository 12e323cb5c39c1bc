use std::fmt;

use lo_events::Warning;

/// Warnings about a shot.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ShotWarning {
    /// The plates do not determine the length of the track's unit, so that it counts as a metre.
    ScaleUnknown,
    /// The scene was estimated with another lens than the track has for its photo.
    OtherLens {
        /// Horizontal field of view of the scene, degrees.
        scene_deg: f64,
        /// Horizontal field of view of the track, degrees.
        track_deg: f64,
    },
}

impl fmt::Display for ShotWarning {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::ScaleUnknown => f.write_str(
                "the plates do not determine the scale of the camera track: its unit counts as a metre, and objects may \
                 slide",
            ),
            Self::OtherLens { scene_deg, track_deg } => write!(
                f,
                "the scene was estimated with a horizontal field of view of {scene_deg:.1}°, but the camera track has \
                 {track_deg:.1}°: objects will slide"
            ),
        }
    }
}

impl Warning for ShotWarning {}
