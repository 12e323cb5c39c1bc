//! Integration tests of image and depth input. One binary, so that it is linked once.
#![allow(clippy::unwrap_used)]

mod color;
mod damaged;
mod exif;
mod heic;
mod jpeg_xl;
mod numpy;
mod real_files;
mod round_trips;
