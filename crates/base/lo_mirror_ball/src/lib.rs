//! Unwraps photos of a mirror ball to an equirectangular panorama (`docs/method.md` §14).
//!
//! [`merge_exposures`] merges a bracket of photos to one linear image, with exposures from [`stops_from_exif`] or
//! [`estimate_stops`]. [`find_ball`] detects the ball in it, and [`unwrap_ball`] converts it to a panorama.

mod alignment;
mod ball;
mod circles;
mod error;
mod exposures;
mod fill;
mod find;
mod slopes;
mod unwrap;
mod view;

pub use alignment::misalignment_px;
pub use ball::{BallCircle, BallLens};
pub use error::BallError;
pub use exposures::{MergedPhotos, estimate_stops, merge_exposures, stops_from_exif};
pub use find::{BallDetection, find_ball};
pub use unwrap::{UnwrapOptions, UnwrappedBall, unwrap_ball};
pub use view::BallView;
