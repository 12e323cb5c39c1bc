use std::fmt;

use lo_events::Warning;
use lo_imaging::{BlackBars, PhotoNote};

/// Warnings of an estimate about its input.
///
/// The libraries below have their own: [`CompletionWarning`](lo_completion::CompletionWarning),
/// [`PanoramaWarning`](lo_completion::PanoramaWarning), [`NetworkWarning`](lo_nets::light::NetworkWarning).
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum EstimateWarning {
    /// An observation about the photo's file.
    PhotoFile(PhotoNote),
    /// Depth is predicted from the photo alone: distances, sizes and the up direction are uncertain.
    PredictedDepth,
    /// Depth of a model or a file is relative; it was fitted to the metric depth of the built-in depth network.
    FittedDepth {
        /// `a` of `1 / z = a · d + b`; 1 if it is the logarithm of depth.
        scale: f64,
        /// `b`.
        offset: f64,
        /// Share of pixels whose depth agrees with the built-in network's within a ratio of 1.25.
        agree: f64,
        /// Median ratio of the two depths, minus 1.
        median_error: f64,
    },
    /// Given depth decreases where the built-in network's increases: it seems to be inverse depth or disparity.
    InverseDepth {
        /// Spearman's rank correlation of the two depths.
        rank_correlation: f64,
    },
    /// Given depth fits the built-in network's better if it is mirrored from left to right.
    MirroredDepth {
        /// Spearman's rank correlation of the two depths.
        rank_correlation: f64,
        /// That of the mirrored map.
        mirrored: f64,
    },
    /// Given depth is the same everywhere, where the photo shows near and far surfaces.
    ConstantDepth {
        /// The depth in metres.
        depth_m: f64,
    },
    /// Given depth is much larger or smaller than the built-in network's: its scale seems wrong.
    DepthScale {
        /// Median ratio of given depth to the built-in network's.
        ratio: f64,
    },
    /// Black bars around the photo were left out of the estimate.
    BlackBars {
        /// The bars, in pixels of the photo.
        bars: BlackBars,
        /// Index of the photo, from 0, if there are several.
        photo: Option<usize>,
    },
    /// The photo is so wide or high that it may be a stitched panorama; it was taken for that of a pinhole camera.
    WidePhoto {
        /// Ratio of the longer to the shorter side.
        aspect: f64,
    },
    /// Lens distortion was undone: the scene has the undistorted photo.
    Undistorted {
        /// Horizontal field of view of the undistorted photo, in degrees.
        hfov_deg: f64,
        /// Horizontal field of view by focal length alone, in degrees.
        pinhole_hfov_deg: f64,
    },
    /// Points outside the octree's cube were discarded.
    OutsideCube {
        /// Number of discarded points.
        outside: usize,
        /// Number of all points.
        points: usize,
    },
    /// Depths of two photos disagree where their poses make them overlap.
    PosesDisagree {
        /// Indices of the photos, from 0.
        photos: [usize; 2],
        /// Median relative difference of the depths.
        disagreement: f32,
    },
    /// Photos overlap neither the first photo nor any photo compared with it: their relative exposures were assumed.
    AssumedExposures {
        /// Indices of the photos, from 0.
        photos: Vec<usize>,
    },
}

/// Smallest share of the field of view that is left by the distortion of a real lens.
const LEAST_KEPT: f64 = 0.6;

impl Warning for EstimateWarning {}

impl fmt::Display for EstimateWarning {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        match self {
            Self::PhotoFile(note) => note.fmt(f),
            Self::PredictedDepth => f.write_str(
                "depth is predicted from the photo alone: distances and sizes are uncertain, and the up direction may \
                 be off by some degrees",
            ),
            Self::FittedDepth { scale, offset, agree, median_error } => write!(
                f,
                "depth is relative; it was fitted to the metric depth of the built-in network by \
                 1/z = {scale:.3e} d {offset:+.3e}: {:.0} % of the pixels agree within a ratio of 1.25, the median \
                 difference is {:.0} %",
                100.0 * agree,
                100.0 * median_error
            ),
            Self::InverseDepth { rank_correlation } => write!(
                f,
                "the depth map looks like inverse depth: where the photo shows near surfaces, its values are large (rank \
                 correlation {rank_correlation:.2} with the built-in network's depth)"
            ),
            Self::MirroredDepth { rank_correlation, mirrored } => write!(
                f,
                "the depth map looks mirrored from left to right: the built-in network's depth has a rank correlation \
                 of {mirrored:.2} with the mirrored map, of {rank_correlation:.2} with the map as it is"
            ),
            Self::ConstantDepth { depth_m } => {
                write!(f, "the depth map is {depth_m:.2} m everywhere, where the photo shows near and far surfaces")
            }
            Self::DepthScale { ratio } if *ratio > 1.0 => write!(
                f,
                "the depth map is {} times as far as the built-in network's depth: scale?",
                two_digits(*ratio)
            ),
            Self::DepthScale { ratio } => write!(
                f,
                "the depth map is {} times as near as the built-in network's depth: scale?",
                two_digits(ratio.recip())
            ),
            Self::BlackBars { bars: BlackBars { left, top, right, bottom }, photo } => {
                let sides = [("left", left), ("top", top), ("right", right), ("bottom", bottom)];
                let sides: Vec<String> = sides
                    .iter()
                    .filter(|(_, pixels)| **pixels > 0)
                    .map(|(side, pixels)| format!("{pixels} pixels at the {side}"))
                    .collect();
                let which = photo.map(|photo| format!(" of photo {}", photo + 1)).unwrap_or_default();
                write!(f, "black bars around the picture{which} are left out of the estimate: {}", sides.join(", "))
            }
            Self::WidePhoto { aspect } => write!(
                f,
                "one side of the photo is {aspect:.1} times the other: if it is a panorama stitched by a phone, crop it \
                 to a part of at most 90°; it is taken for the photo of a pinhole camera"
            ),
            Self::Undistorted { hfov_deg, pinhole_hfov_deg } if *hfov_deg < LEAST_KEPT * pinhole_hfov_deg => write!(
                f,
                "without its lens distortion the photo has a horizontal field of view of {hfov_deg:.1}° instead of \
                 {pinhole_hfov_deg:.1}°: check the coefficients and their order"
            ),
            Self::Undistorted { hfov_deg, .. } => write!(
                f,
                "lens distortion is undone: the scene's photo has a horizontal field of view of {hfov_deg:.1}°; \
                 composites are distorted back"
            ),
            Self::OutsideCube { outside, points } => {
                write!(f, "{outside} of {points} points are outside the octree's cube and were discarded")
            }
            Self::PosesDisagree { photos: [a, b], disagreement } => write!(
                f,
                "photos {} and {} overlap according to their poses, but their depths differ there by {:.0} %: check \
                 the poses",
                a + 1,
                b + 1,
                100.0 * disagreement
            ),
            Self::AssumedExposures { photos } => match &photos[..] {
                [photo] => write!(
                    f,
                    "photo {} overlaps none of the photos before it, so its exposure is estimated from its brightness",
                    photo + 1
                ),
                _ => {
                    let photos: Vec<String> = photos.iter().map(|photo| (photo + 1).to_string()).collect();
                    write!(
                        f,
                        "photos {} overlap none of the photos before them, so their exposures are estimated from their \
                         brightness",
                        photos.join(", ")
                    )
                }
            },
        }
    }
}

/// Formats a factor from 1 on with two significant digits.
fn two_digits(factor: f64) -> String {
    if factor < 10.0 { format!("{factor:.1}") } else { format!("{factor:.0}") }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn photos_are_numbered_from_one() {
        let disagree = EstimateWarning::PosesDisagree { photos: [0, 2], disagreement: 0.085 };
        assert!(disagree.to_string().starts_with("photos 1 and 3 overlap"), "{disagree}");
        let assumed = |photos: &[usize]| EstimateWarning::AssumedExposures { photos: photos.to_vec() }.to_string();
        assert!(assumed(&[1]).starts_with("photo 2 overlaps none"), "{}", assumed(&[1]));
        assert!(assumed(&[1, 3]).starts_with("photos 2, 4 overlap none"), "{}", assumed(&[1, 3]));
    }
}
