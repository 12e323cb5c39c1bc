use lo_geometry::{MAX_COORDINATE_M, Mat3, Plane, Vec3};
use serde::{Deserialize, Serialize};

/// Method by which unobserved regions of a scene were completed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Completion {
    /// The light network.
    Network,
    /// Fitted planes and diffuse extrapolation.
    Shell,
    /// None: only observed regions are there.
    #[default]
    None,
}

/// Side of the room that a plane closes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Side {
    /// Floor; its normal is the up vector.
    Floor,
    /// Ceiling; its normal is the down vector.
    Ceiling,
    /// Wall; its normal is horizontal.
    Wall,
}

/// One plane of the room's closing box.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct RoomPlane {
    /// Side that it closes.
    pub side: Side,
    /// The plane; its normal points into the room.
    pub plane: Plane,
    /// Whether it was fitted to readings instead of assumed.
    pub measured: bool,
}

/// Layout of a room: gravity and the six planes that close it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Room {
    /// Unit vector against gravity, in the world frame.
    pub up: Vec3,
    /// Floor, ceiling and walls.
    pub planes: Vec<RoomPlane>,
}

impl Room {
    /// Returns the floor plane, if there is one.
    pub fn floor(&self) -> Option<Plane> {
        self.planes.iter().find(|p| p.side == Side::Floor).map(|p| p.plane)
    }

    /// Returns the rotation from the camera's frame to a level one: up is +Y, and the camera's heading −Z.
    ///
    /// For a camera that looks straight up or down, the heading is where the bottom or the top of its image points.
    pub fn level_from_camera(&self) -> Mat3 {
        let up = self.up.normalize();
        let steep = if up.z > 0.0 { Vec3::Y } else { Vec3::NEG_Y };
        let ahead = [Vec3::NEG_Z, steep].map(|ahead| ahead.reject_from_normalized(up));
        let back = -(if ahead[0].length() > 1e-3 { ahead[0] } else { ahead[1] }).normalize();
        Mat3::from_cols(up.cross(back), up, back).transpose()
    }

    /// Returns whether all planes are within [`MAX_COORDINATE_M`] and all directions have unit length.
    pub(crate) fn is_valid(&self) -> bool {
        let unit = |v: Vec3| (v.length_squared() - 1.0).abs() < 1e-3;
        unit(self.up) && self.planes.iter().all(|p| unit(p.plane.normal) && p.plane.offset_m.abs() <= MAX_COORDINATE_M)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn level_frames_have_gravity_straight_down_and_the_cameras_heading_ahead() {
        for (x, y, z) in [(0.1, 0.9, 0.4), (-0.2, 0.8, -0.5), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0), (0.0, 0.0, -1.0)] {
            let up = Vec3::new(x, y, z).normalize();
            let level = Room { up, planes: Vec::new() }.level_from_camera();
            assert!((level * up - Vec3::Y).length() < 1e-5, "{up}");
            let ahead = level * Vec3::NEG_Z;
            assert!(ahead.x.abs() < 1e-5 && ahead.z < 1e-5, "{up}: {ahead}");
            // Looking down, the top of the image is ahead; looking up, the bottom.
            let top = level * Vec3::Y;
            assert!(z.abs() < 1.0 || top.z * z < -0.99, "{up}: {top}");
        }
    }
}
