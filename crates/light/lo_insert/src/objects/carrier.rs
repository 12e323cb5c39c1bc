use lo_geometry::{Camera, Plane, Ray, Vec3};

use crate::objects::object::Object;
use crate::{Base, InsertError, Instance, Placement};

/// Smallest cosine to the carrier's up of a surface that supports objects; objects on steeper ones are placed on top
/// of the carrier.
const SIDE: f32 = 0.7;

/// Height above the visible point from which an object is dropped, as a share of its carrier's radius.
const DROP: f32 = 0.02;

/// Position on a carrier at which an object is placed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Anchor {
    /// The centre of its top.
    Middle,
    /// The point straight below a world point in metres, along the carrier's up.
    Below(Vec3),
    /// The point where the ray through photo position (u, v), pixel centres at +0.5, meets it.
    Pixel(f64, f64),
}

impl Placement {
    /// Places the object on another one: drops it along the carrier's up until its base touches.
    ///
    /// The carrier's support becomes its support, because the octree does not contain the carrier: points low on the
    /// object are near a real surface.
    ///
    /// # Errors
    /// If the carrier's model has no extent, or the object would miss it.
    pub fn on_object(
        self,
        carrier: &Instance,
        anchor: Anchor,
        base: &Base,
        camera: &Camera,
    ) -> Result<Self, InsertError> {
        let object = Object::new(carrier)?;
        let up = carrier.placement.up;
        let above_all = |point: Vec3| {
            let top = Plane::through(object.centre_m + up * (1.01 * object.radius_m), up);
            point - up * top.signed_distance_m(point)
        };
        let from_m = match anchor {
            Anchor::Middle => above_all(object.centre_m),
            Anchor::Below(point) => point,
            Anchor::Pixel(u, v) => {
                let ray = Ray { origin: Vec3::ZERO, direction: camera.direction(u, v) };
                let hit =
                    object.seen(&ray, 0.0).ok_or(InsertError::NotCarried("the pixel does not show the carrier"))?;
                let point = ray.at(hit.distance_m);
                let normal = object.triangle_normal(hit.triangle);
                // Triangles may have either winding; seen from the camera the normal faces it.
                let faces_up = normal.dot(up) * -normal.dot(ray.direction).signum() > SIDE;
                if faces_up { point + up * (DROP * object.radius_m) } else { above_all(point) }
            }
        };
        let placed = Self { up, support: carrier.placement.support, ..self };
        let fall_m = |offset_m: Vec3| {
            let ray = Ray { origin: from_m + offset_m, direction: -up };
            object.first(&ray, f32::INFINITY).map(|hit| hit.distance_m)
        };
        let sample_points = base.sample_points(placed.scale, placed.rotation()).chain([Vec3::ZERO]);
        let fall_m = sample_points
            .filter_map(fall_m)
            .reduce(f32::min)
            .ok_or(InsertError::NotCarried("the carrier is not below the object"))?;
        Ok(Self { position_m: from_m - up * fall_m, ..placed })
    }

    /// Returns the placement moved and rotated with its carrier, which moved from one placement to another.
    #[must_use]
    pub fn moved_with_carrier(self, from: &Self, to: &Self) -> Self {
        let turned = to.rotation() * from.rotation().conjugate();
        let position_m = to.position_m + turned * (self.position_m - from.position_m) * (to.scale / from.scale);
        let yaw_rad = self.yaw_rad + to.yaw_rad - from.yaw_rad;
        Self { position_m, up: to.up, yaw_rad, support: to.support, ..self }
    }
}
