use lo_geometry::{Mat3, Plane, Vec3};
use serde::{Deserialize, Serialize};

/// How the unseen part of a scene was completed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Completion {
    /// By the light network.
    Network,
    /// By fitted planes and diffuse extrapolation.
    Shell,
    /// Not at all: only what the photo saw is there.
    #[default]
    None,
}

/// Which side of the room a plane closes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Side {
    /// Its normal is the up vector.
    Floor,
    /// Its normal is the down vector.
    Ceiling,
    /// Its normal is horizontal.
    Wall,
}

/// One plane of the room's closing box.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct RoomPlane {
    /// Which side it closes.
    pub side: Side,
    /// The plane; its normal points into the room.
    pub plane: Plane,
    /// Whether it was fitted to readings; otherwise it was assumed.
    pub measured: bool,
}

/// The layout of a room: gravity and the six planes that close it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Room {
    /// Unit vector against gravity, world frame.
    pub up: Vec3,
    /// Floor, ceiling and walls.
    pub planes: Vec<RoomPlane>,
}

impl Room {
    /// The floor plane, where there is one.
    pub fn floor(&self) -> Option<Plane> {
        self.planes.iter().find(|p| p.side == Side::Floor).map(|p| p.plane)
    }

    /// What turns directions of the camera's frame into those of a level one: up is +Y, and the camera's heading −Z. A camera that looks
    /// straight up or down heads for where the bottom or the top of its picture points.
    pub fn level_from_camera(&self) -> Mat3 {
        let up = self.up.normalize();
        let steep = if up.z > 0.0 { Vec3::Y } else { Vec3::NEG_Y };
        let ahead = [Vec3::NEG_Z, steep].map(|ahead| ahead.reject_from_normalized(up));
        let back = -(if ahead[0].length() > 1e-3 { ahead[0] } else { ahead[1] }).normalize();
        Mat3::from_cols(up.cross(back), up, back).transpose()
    }

    /// Whether all numbers are finite and all directions of unit length.
    pub(crate) fn is_valid(&self) -> bool {
        let unit = |v: Vec3| (v.length_squared() - 1.0).abs() < 1e-3;
        unit(self.up) && self.planes.iter().all(|p| unit(p.plane.normal) && p.plane.offset_m.is_finite())
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
            // Looking down, the top of the picture is ahead; looking up, the bottom.
            let top = level * Vec3::Y;
            assert!(z.abs() < 1.0 || top.z * z < -0.99, "{up}: {top}");
        }
    }
}
