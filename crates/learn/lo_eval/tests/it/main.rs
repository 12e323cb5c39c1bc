//! Cameras, photos and published figures. One binary, so that it is linked once.
#![allow(clippy::unwrap_used, missing_docs)]

mod camera;
mod photos;
mod published;
mod sun;
