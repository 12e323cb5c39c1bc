//! Photos of a mirror ball become an equirectangular panorama (`docs/method.md` §14).
//!
//! [`stops_from_exif`] or [`estimate_stops`] and [`merge_exposures`] make one picture of linear light of several photos, [`find_ball`]
//! finds the ball in it, and [`unwrap_ball`] turns it into a panorama.

mod alignment;
mod circles;
mod exposures;
mod fill;
mod find;
mod slopes;
mod unwrap;
mod view;

pub use alignment::misalignment_px;
pub use exposures::{MergedPhotos, estimate_stops, merge_exposures, stops_from_exif};
pub use find::{BallFind, find_ball};
pub use unwrap::{UnwrapOptions, UnwrappedBall, unwrap_ball};
pub use view::{BallCircle, BallLens, BallView};

/// Why photos of a mirror ball give no panorama. Photos count from 0.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum BallError {
    /// The outline has no size.
    #[error("a circle at ({}, {}) with a radius of {} pixels is none that could be unwrapped", circle.x, circle.y, circle.radius_px)]
    Circle {
        /// As given.
        circle: BallCircle,
    },
    /// The outline is not one in this photo.
    #[error(
        "the circle at ({}, {}) with a radius of {} pixels does not lie in the photo of {width} × {height} pixels",
        circle.x, circle.y, circle.radius_px
    )]
    CircleOutside {
        /// As given.
        circle: BallCircle,
        /// Of the photo, in pixels.
        width: usize,
        /// Of the photo, in pixels.
        height: usize,
    },
    /// The lens is none, or cannot show a ball of that outline.
    #[error("{}", lens_text(lens))]
    Lens {
        /// As given.
        lens: BallLens,
    },
    /// Photos differ in size.
    #[error("photo {} has {} × {} pixels, the first one {} × {}", photo + 1, size[0], size[1], first[0], first[1])]
    Sizes {
        /// Which.
        photo: usize,
        /// Its width and height.
        size: [usize; 2],
        /// Those of the first.
        first: [usize; 2],
    },
    /// A pixel is NaN or infinite.
    #[error("pixel ({x}, {y}) of photo {} is not a finite number", photo + 1)]
    NotFinite {
        /// Which.
        photo: usize,
        /// Its column.
        x: usize,
        /// Its row.
        y: usize,
    },
    /// There are not as many exposures as photos, or one is not a number.
    #[error("{photos} photos need as many finite exposures, got {exposures}")]
    Exposures {
        /// Photos.
        photos: usize,
        /// Finite exposures.
        exposures: usize,
    },
    /// Two photos, neighbours in brightness, show too little in common to compare their exposures.
    #[error("photos {} and {} have only {pixels} pixels that are well exposed in both", photos[0] + 1, photos[1] + 1)]
    NothingInCommon {
        /// Which.
        photos: [usize; 2],
        /// Well exposed in both.
        pixels: usize,
    },
    /// No photo, or one without pixels.
    #[error("there is no photo")]
    NoPhoto,
    /// The panorama's size or an option of it is none.
    #[error("{what} must be {range}, got {value}")]
    Option {
        /// The option.
        what: &'static str,
        /// What it may be.
        range: &'static str,
        /// What it is.
        value: f64,
    },
}

fn lens_text(lens: &BallLens) -> String {
    match lens {
        BallLens::Orthographic => "a ball seen from far away needs no lens".to_owned(),
        BallLens::Focal { focal_px } => {
            format!("a lens with a focal length of {focal_px:.1} pixels cannot show a ball of that outline")
        }
        BallLens::Distance { radii } => {
            format!("a ball whose centre is {radii:.3} of its radii away cannot have that outline")
        }
    }
}
