use glam::Vec3;
use serde::{Deserialize, Serialize};

use crate::{Ray, RigidTransform};

/// The plane of all points `p` with `normal · p = offset_m`, for a normal of unit length.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Plane {
    /// Unit normal; for a wall it points into the room.
    pub normal: Vec3,
    /// Distance of the plane from the world's origin along the normal, in metres.
    pub offset_m: f32,
}

impl Plane {
    /// Creates the plane through `point` with unit `normal`.
    #[inline]
    pub fn through(point: Vec3, normal: Vec3) -> Self {
        Self { normal, offset_m: normal.dot(point) }
    }

    /// Signed distance of a point from the plane, in metres; negative behind it.
    #[inline]
    pub fn signed_distance_m(&self, point: Vec3) -> f32 {
        self.normal.dot(point) - self.offset_m
    }

    /// Returns the nearest point on the plane.
    #[inline]
    pub fn project(&self, point: Vec3) -> Vec3 {
        point - self.normal * self.signed_distance_m(point)
    }

    /// Returns the plane in other axes.
    pub fn moved(&self, to_from: &RigidTransform) -> Self {
        Self::through(to_from.point(self.normal * self.offset_m), to_from.direction(self.normal))
    }

    /// Returns the distance at which a ray hits the plane, in metres; `None` if it runs parallel to it or away from it.
    #[inline]
    pub fn intersect(&self, ray: &Ray) -> Option<f32> {
        let speed = self.normal.dot(ray.direction);
        let distance = -self.signed_distance_m(ray.origin) / speed;
        (distance.is_finite() && distance > 0.0).then_some(distance)
    }
}

#[cfg(test)]
mod tests {
    use std::f32::consts::FRAC_PI_2;

    use glam::Quat;

    use super::*;

    #[test]
    fn distances_and_hits() {
        let floor = Plane::through(Vec3::new(3.0, -1.5, 2.0), Vec3::Y);
        assert_eq!(floor.signed_distance_m(Vec3::ZERO), 1.5);
        assert_eq!(floor.project(Vec3::X), Vec3::new(1.0, -1.5, 0.0));
        assert_eq!(floor.intersect(&Ray { origin: Vec3::ZERO, direction: Vec3::NEG_Y }), Some(1.5));
        assert_eq!(floor.intersect(&Ray { origin: Vec3::ZERO, direction: Vec3::Y }), None);
        assert_eq!(floor.intersect(&Ray { origin: Vec3::ZERO, direction: Vec3::X }), None);
        let turn =
            RigidTransform { rotation: Quat::from_rotation_z(FRAC_PI_2), translation_m: Vec3::new(1.0, 2.0, 0.0) };
        let moved = floor.moved(&turn);
        for point in [Vec3::new(3.0, -1.5, 2.0), Vec3::new(-4.0, 0.5, 1.0)] {
            let distances_m = (moved.signed_distance_m(turn.point(point)), floor.signed_distance_m(point));
            assert!((distances_m.0 - distances_m.1).abs() < 1e-5, "{distances_m:?}");
        }
    }
}
