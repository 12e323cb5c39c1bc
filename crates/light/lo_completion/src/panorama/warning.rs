use std::fmt;

use lo_events::Warning;

/// Warnings about a panorama of the room.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum PanoramaWarning {
    /// The panorama is not HDR: radiance of its clipped pixels is a lower bound.
    Clipped {
        /// Share of clipped pixels, from 0 to 1.
        clipped_share: f32,
    },
    /// The panorama shows a part of the sphere, by its GPano metadata; the rest stays estimated.
    Partial {
        /// Share of its pixels that are shown, from 0 to 1.
        covered_share: f32,
    },
    /// Negative, NaN and infinite values were replaced by 0.
    Values {
        /// Number of pixels with such values.
        cleaned: usize,
        /// Number of all pixels.
        pixels: usize,
    },
    /// The panorama matches the photo poorly: it may be of another room or position, or have another orientation.
    PoorMatch {
        /// Confidence of the match, from 0 to 1.
        confidence: f32,
        /// Confidence below which this warning is given.
        least: f32,
        /// Yaw with which the panorama is used, in degrees.
        yaw_deg: f32,
    },
    /// The panorama's position sees too little of the observed region for a comparison with the photo.
    NotCompared,
}

impl Warning for PanoramaWarning {}

impl fmt::Display for PanoramaWarning {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        match self {
            Self::Clipped { clipped_share } => write!(
                f,
                "the panorama is not HDR: {:.1} % of it is clipped, so lamps may be brighter than it shows",
                100.0 * clipped_share
            ),
            Self::Partial { covered_share } => write!(
                f,
                "the panorama shows {:.0} % of the sphere by its metadata; the rest stays estimated",
                100.0 * covered_share
            ),
            Self::Values { cleaned, pixels } => {
                write!(f, "{cleaned} of the panorama's {pixels} pixels are negative, NaN or infinite and were set to 0")
            }
            Self::PoorMatch { confidence, least, .. } => write!(
                f,
                "the panorama matches the photo poorly (confidence {confidence:.2}, expected at least {least:.2})"
            ),
            Self::NotCompared => {
                f.write_str("the panorama's position sees too little of what the photo shows, so its yaw is uncertain")
            }
        }
    }
}
