use super::ball::{BallCircle, BallLens, MIN_RADIUS_PX};

/// Errors of unwrapping a mirror ball. Fields count photos from 0, messages from 1.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum BallError {
    /// The outline is too small, or a coordinate is NaN or infinite.
    #[error(
        "the circle at ({}, {}) with a radius of {} pixels cannot be unwrapped: the radius must be at least {} pixels",
        circle.x, circle.y, circle.radius_px, MIN_RADIUS_PX
    )]
    Circle {
        /// The given outline.
        circle: BallCircle,
    },
    /// The outline's centre is outside the photo, or its radius exceeds the photo's longer side.
    #[error(
        "the circle at ({}, {}) with a radius of {} pixels is outside the photo of {width} × {height} pixels, \
         or larger than it",
        circle.x, circle.y, circle.radius_px
    )]
    CircleOutside {
        /// The given outline.
        circle: BallCircle,
        /// Width of the photo in pixels.
        width: usize,
        /// Height of the photo in pixels.
        height: usize,
    },
    /// The lens is invalid, or does not fit the ball's outline.
    #[error("{}", lens_message(lens))]
    Lens {
        /// The given lens.
        lens: BallLens,
    },
    /// Photos differ in size.
    #[error(
        "photo {} has {} × {} pixels, but the first one has {} × {}; all photos must have the same size",
        photo + 1, size[0], size[1], first[0], first[1]
    )]
    Sizes {
        /// Index of the photo.
        photo: usize,
        /// Width and height of the photo.
        size: [usize; 2],
        /// Width and height of the first photo.
        first: [usize; 2],
    },
    /// A pixel is NaN or infinite.
    #[error("pixel ({x}, {y}) of photo {} is NaN or infinite", photo + 1)]
    NotFinite {
        /// Index of the photo.
        photo: usize,
        /// Column of the pixel.
        x: usize,
        /// Row of the pixel.
        y: usize,
    },
    /// The number of exposures differs from that of photos, or an exposure is not finite or beyond ±40 stops.
    #[error("{photos} photos need as many exposures within ±40 stops, got {exposures}")]
    Exposures {
        /// Number of photos.
        photos: usize,
        /// Number of valid exposures.
        exposures: usize,
    },
    /// Two photos, neighbours in brightness, have too few well-exposed pixels in common to compare their exposures.
    #[error(
        "photos {} and {} have only {pixels} pixels that are well exposed in both, too few to compare their exposures",
        photos[0] + 1, photos[1] + 1
    )]
    NothingInCommon {
        /// Indices of the photos.
        photos: [usize; 2],
        /// Number of samples that are well exposed in both.
        pixels: usize,
    },
    /// No photo was given, or one without pixels.
    #[error("no photo was given, or the photo has no pixels")]
    NoPhoto,
    /// The panorama's size or an option is out of range.
    #[error("{what} must be {range}, got {value}")]
    InvalidOption {
        /// Name of the option.
        what: &'static str,
        /// Valid range.
        range: &'static str,
        /// Given value.
        value: f64,
    },
}

fn lens_message(lens: &BallLens) -> String {
    match lens {
        BallLens::Orthographic => "an orthographic view does not fit the ball's outline".to_owned(),
        BallLens::Focal { focal_px } => {
            format!("a focal length of {focal_px:.1} pixels does not fit the ball's outline")
        }
        BallLens::Distance { radii } => {
            format!("a distance of {radii:.3} radii from the camera to the ball's centre does not fit its outline")
        }
    }
}
