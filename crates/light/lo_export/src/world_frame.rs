//! World frame of an export: the camera's, or a levelled one with gravity straight down and the floor at height 0.

use lo_geometry::{Mat3, Vec3};
use lo_scene::Room;

use crate::ExportError;

/// Rigid transform from the camera's frame to the world.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct WorldFrame {
    /// Rotation from the camera's axes to the world's.
    pub rotation: Mat3,
    /// Position of the camera in metres.
    pub camera_m: Vec3,
}

impl WorldFrame {
    /// The frame of the photo's camera, as in scenes.
    pub const CAMERA: Self = Self { rotation: Mat3::IDENTITY, camera_m: Vec3::ZERO };

    /// Returns the levelled frame: up is +Y, the camera looks towards −Z, at its height above the floor over the
    /// origin (0 without a floor).
    ///
    /// # Errors
    /// If the room, and with it gravity, is unknown.
    pub fn of(room: Option<&Room>) -> Result<Self, ExportError> {
        let room = room.ok_or(ExportError::NoGravity)?;
        let height_m = room.floor().map_or(0.0, |floor| -floor.offset_m / floor.normal.dot(room.up.normalize()));
        Ok(Self { rotation: room.level_from_camera(), camera_m: Vec3::Y * height_m })
    }

    /// Returns the columns of the matrix from the camera's frame to the world's.
    pub fn columns(self) -> [[f32; 4]; 4] {
        let [x, y, z] = [self.rotation.x_axis, self.rotation.y_axis, self.rotation.z_axis].map(|c| c.extend(0.0));
        [x, y, z, self.camera_m.extend(1.0)].map(|c| c.to_array())
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use lo_geometry::Plane;
    use lo_scene::{RoomPlane, Side};

    use super::*;

    #[test]
    fn up_is_y_and_the_floor_is_at_zero() {
        for (x, y, z) in [(0.1, 0.9, 0.4), (-0.2, 0.8, -0.5), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0), (0.0, 0.0, -1.0)] {
            let up = Vec3::new(x, y, z).normalize();
            let plane = Plane { normal: up, offset_m: -1.4 };
            let room = Room { up, planes: vec![RoomPlane { side: Side::Floor, plane, measured: true }] };
            let level = WorldFrame::of(Some(&room)).unwrap();
            let world = |p: Vec3| level.rotation * p + level.camera_m;
            assert!((level.rotation * up - Vec3::Y).length() < 1e-6);
            assert!((level.rotation.determinant() - 1.0).abs() < 1e-5);
            assert!(world(up * -1.4 + up.any_orthogonal_vector()).y.abs() < 1e-5);
            let ahead = level.rotation * Vec3::NEG_Z;
            assert!(ahead.x.abs() < 1e-6 && ahead.z < 1e-6, "{ahead}");
        }
        assert!(matches!(WorldFrame::of(None), Err(ExportError::NoGravity)));
    }
}
