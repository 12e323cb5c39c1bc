//! Integration tests of image, depth and mirror ball input. One binary, so that it is linked once.
#![allow(clippy::unwrap_used)]

mod damaged;
mod exif;
mod mirror_ball;
mod real_files;
mod round_trips;
