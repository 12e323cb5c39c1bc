use lo_geometry::{Plane, Vec3};
use lo_scene::Scene;

use crate::{InsertError, surface_at_pixel};

/// Surfaces tilted less than this against the room's up are taken as level: depth noise tilts fitted normals by a few degrees.
const LEVEL_DEG: f32 = 10.0;

/// An object stands square on surfaces tilted up to here; it leans on nothing steeper and stays upright there.
const STANDING_DEG: f32 = 40.0;

/// Where an object stands and how it is turned.
///
/// The middle of the base of the model's bounding box comes to `position_m`, its +Y points along `up`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Placement {
    /// World position of the object's base, in metres.
    pub position_m: Vec3,
    /// Metres per unit of the model.
    pub scale: f32,
    /// Rotation about `up`, counter-clockwise seen from above, in radians.
    pub yaw_rad: f32,
    /// Unit vector that the model's +Y is turned to.
    pub up: Vec3,
    /// The surface that the object rests on, if any; light is gathered from above it.
    pub support: Option<Plane>,
}

impl Placement {
    /// Upright at a world position, in the scene's gravity where it is known; the floor supports it if it is near.
    pub fn at(scene: &Scene, position_m: Vec3) -> Self {
        let up = scene.room.as_ref().map_or(Vec3::Y, |room| room.up);
        let near = 2.0 * scene.light.cube.node_edge_m(scene.light.octree.depth());
        let floor = scene.room.as_ref().and_then(|room| room.floor());
        let support = floor.filter(|floor| floor.signed_distance_m(position_m).abs() < near);
        Self { position_m, scale: 1.0, yaw_rad: 0.0, up, support }
    }

    /// Resting on the surface seen at photo position `(u, v)`, pixel centres at +0.5.
    ///
    /// On a level surface the object stands along gravity (+Y where the room's up is unknown), on a slope up to 40° along the surface's normal, beside anything
    /// steeper upright.
    ///
    /// # Errors
    /// Outside of the photo, and where the depth map has no reading.
    pub fn rest_on_pixel(scene: &Scene, u: f64, v: f64) -> Result<Self, InsertError> {
        let (position_m, normal) = surface_at_pixel(scene, u, v)?;
        let gravity = scene.room.as_ref().map_or(Vec3::Y, |room| room.up);
        let tilt_deg = normal.dot(gravity).clamp(-1.0, 1.0).acos().to_degrees();
        let level_deg = if scene.room.is_some() { LEVEL_DEG } else { 0.0 };
        let up = if tilt_deg > level_deg && tilt_deg < STANDING_DEG { normal } else { gravity };
        let support = (tilt_deg < STANDING_DEG).then(|| Plane::through(position_m, up));
        Ok(Self { position_m, scale: 1.0, yaw_rad: 0.0, up, support })
    }

    /// The same place with another scale, in metres per unit of the model.
    pub fn scaled(self, scale: f32) -> Self {
        Self { scale, ..self }
    }

    /// The same place, turned to another yaw in radians.
    pub fn turned(self, yaw_rad: f32) -> Self {
        Self { yaw_rad, ..self }
    }

    /// # Errors
    /// Where a number is NaN, infinite or out of range.
    pub(crate) fn check(&self) -> Result<(), InsertError> {
        let bad = |name, needed, found: String| Err(InsertError::Placement { name, needed, found });
        if !(self.position_m.is_finite() && self.position_m.abs().max_element() < 1e4) {
            return bad("the position", "three finite numbers below 10 km", self.position_m.to_string());
        }
        if !(self.scale.is_finite() && self.scale > 1e-6 && self.scale < 1e6) {
            return bad("the scale", "a number between 1e-6 and 1e6", self.scale.to_string());
        }
        if !self.yaw_rad.is_finite() {
            return bad("the yaw", "a finite angle", self.yaw_rad.to_string());
        }
        if (self.up.length_squared() - 1.0).abs() > 1e-3 || !self.up.is_finite() {
            return bad("the up direction", "a unit vector", self.up.to_string());
        }
        Ok(())
    }
}
