use lo_geometry::{Camera, RigidTransform, is_position};
use serde::{Deserialize, Serialize};

use crate::Frame;
use crate::frame::EXPOSURES;

/// A frame with its pose, one of several of a room.
#[derive(Clone, Debug, PartialEq)]
pub struct PosedFrame {
    /// The photo with its depth, in its own camera's axes.
    pub frame: Frame,
    /// Transform from its camera's axes to those of the first photo's camera.
    pub first_from_camera: RigidTransform,
}

/// Camera and exposure of a further photo of a scene. The photo itself is not stored.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct OtherPhoto {
    /// Transform from its camera's axes to those of the first photo's camera.
    pub first_from_camera: RigidTransform,
    /// Camera, in pixels of the photo.
    pub camera: Camera,
    /// Factor from its linear values to radiance.
    pub exposure: f32,
}

impl OtherPhoto {
    /// Returns whether the pose is rigid and near, and camera and exposure are in range.
    pub(crate) fn is_valid(&self) -> bool {
        let RigidTransform { rotation, translation_m } = self.first_from_camera;
        let Camera { fx, fy, cx, cy, width, height } = self.camera;
        rotation.is_finite()
            && (rotation.length_squared() - 1.0).abs() < 1e-3
            && is_position(translation_m)
            && Camera::new(fx, fy, cx, cy, width, height).is_ok()
            && EXPOSURES.contains(&self.exposure)
    }
}
