//! Sharpness and grain of the photo, for the objects.

mod grain;
mod sharpness;

pub(crate) use grain::Grain;
pub(crate) use sharpness::{Cover, Sharpness, softened};

use lo_imaging::Photo;
use lo_scene::Frame;

/// Traces of lens and sensor in a photo.
#[derive(Clone)]
pub(crate) struct Look {
    pub sharpness: Sharpness,
    /// `None` in a photo without noise, such as a rendered one.
    pub grain: Option<Grain>,
}

impl Look {
    /// Measures the sharpness of a frame and the grain of the photo that composites are made of.
    pub fn measure(frame: &Frame, photo: &Photo) -> Self {
        Self { sharpness: Sharpness::measure(frame), grain: Grain::measure(photo) }
    }
}
