use lo_geometry::{Plane, Vec3};
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

    /// Whether all numbers are finite and all directions of unit length.
    pub(crate) fn is_valid(&self) -> bool {
        let unit = |v: Vec3| (v.length_squared() - 1.0).abs() < 1e-3;
        unit(self.up) && self.planes.iter().all(|p| unit(p.plane.normal) && p.plane.offset_m.is_finite())
    }
}
