use lo_geometry::{Camera, RigidTransform};
use serde::{Deserialize, Serialize};

use crate::Frame;

/// One of several photos of a room.
#[derive(Clone, Debug, PartialEq)]
pub struct PosedFrame {
    /// The photo with its depth, in its own camera's axes.
    pub frame: Frame,
    /// Where its camera stands in the axes of the first photo's camera.
    pub first_from_camera: RigidTransform,
}

/// What a scene keeps of a photo beside its first one: where it was taken from and how.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct OtherPhoto {
    /// Where its camera stands in the axes of the first photo's camera.
    pub first_from_camera: RigidTransform,
    /// Its camera, in pixels of the photo.
    pub camera: Camera,
    /// Factor by which its linear values were multiplied to give radiance.
    pub exposure: f32,
}

impl OtherPhoto {
    /// Whether all numbers are those of a camera somewhere.
    pub(crate) fn is_valid(&self) -> bool {
        let RigidTransform { rotation, translation_m } = self.first_from_camera;
        let Camera { fx, fy, cx, cy, width, height } = self.camera;
        rotation.is_finite()
            && (rotation.length_squared() - 1.0).abs() < 1e-3
            && translation_m.is_finite()
            && Camera::new(fx, fy, cx, cy, width, height).is_ok()
            && self.exposure.is_finite()
            && self.exposure > 0.0
    }
}
