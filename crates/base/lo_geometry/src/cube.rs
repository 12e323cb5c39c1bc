use glam::Vec3;
use serde::{Deserialize, Serialize};

use crate::Ray;

/// The axis-aligned cube that an octree divides: lowest corner and edge length in metres.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Cube {
    /// Corner with the lowest coordinates, in metres.
    pub origin_m: Vec3,
    /// Edge length in metres.
    pub edge_m: f32,
}

impl Cube {
    /// Creates the cube centred at `centre` with edge `edge_m`.
    #[inline]
    pub fn centred(centre: Vec3, edge_m: f32) -> Self {
        Self { origin_m: centre - Vec3::splat(0.5 * edge_m), edge_m }
    }

    /// Centre of the cube, in metres.
    #[inline]
    pub fn centre_m(&self) -> Vec3 {
        self.origin_m + Vec3::splat(0.5 * self.edge_m)
    }

    /// Edge length of a node at `depth`, in metres.
    #[inline]
    pub fn node_edge_m(&self, depth: u32) -> f32 {
        self.edge_m / (1u64 << depth) as f32
    }

    /// Whether a point is inside the half-open cube `[origin, origin + edge)`.
    #[inline]
    pub fn contains(&self, point: Vec3) -> bool {
        let p = point - self.origin_m;
        p.min_element() >= 0.0 && p.max_element() < self.edge_m
    }

    /// Pulls a point outside the cube towards the world's origin, onto the side where its line of sight leaves the
    /// cube.
    ///
    /// Distant surfaces, seen through a window or a door, thus stay in the same direction for the camera. Points inside
    /// are returned unchanged. The cube must contain the world's origin.
    #[inline]
    pub fn pulled_inside(&self, point: Vec3) -> Vec3 {
        let (low, high) = (self.origin_m * 0.999, (self.origin_m + Vec3::splat(self.edge_m)) * 0.999);
        let mut scale = 1.0f32;
        for axis in 0..3 {
            if point[axis] < low[axis] {
                scale = scale.min(low[axis] / point[axis]);
            } else if point[axis] > high[axis] {
                scale = scale.min(high[axis] / point[axis]);
            }
        }
        point * scale
    }

    /// Returns coordinates that are in `[0, 1)³` for points inside the cube.
    #[inline]
    pub fn unit_from_world(&self, point: Vec3) -> Vec3 {
        (point - self.origin_m) / self.edge_m
    }

    /// Inverse of [`Cube::unit_from_world`].
    #[inline]
    pub fn world_from_unit(&self, unit: Vec3) -> Vec3 {
        self.origin_m + unit * self.edge_m
    }

    /// Returns the distances at which a ray enters and leaves the cube; `None` if it misses. The entry is 0 for an
    /// origin inside.
    #[inline]
    pub fn intersect(&self, ray: &Ray) -> Option<(f32, f32)> {
        let inverse = ray.direction.recip();
        let a = (self.origin_m - ray.origin) * inverse;
        let b = (self.origin_m + Vec3::splat(self.edge_m) - ray.origin) * inverse;
        let near = a.min(b).max_element().max(0.0);
        let far = a.max(b).min_element();
        (near <= far).then_some((near, far))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rays_enter_and_leave_where_they_should() {
        let cube = Cube { origin_m: Vec3::ZERO, edge_m: 2.0 };
        let ray = Ray { origin: Vec3::new(-1.0, 1.0, 1.0), direction: Vec3::X };
        assert_eq!(cube.intersect(&ray), Some((1.0, 3.0)));
        assert_eq!(cube.intersect(&Ray { origin: Vec3::ONE, direction: Vec3::NEG_Y }), Some((0.0, 1.0)));
        assert_eq!(cube.intersect(&Ray { origin: Vec3::splat(3.0), direction: Vec3::X }), None);
        assert_eq!(cube.unit_from_world(cube.centre_m()), Vec3::splat(0.5));
        // seen from the origin, which must be inside
        let around = Cube::centred(Vec3::ZERO, 2.0);
        assert_eq!(around.pulled_inside(Vec3::new(0.5, -0.2, -0.3)), Vec3::new(0.5, -0.2, -0.3));
        let far = around.pulled_inside(Vec3::new(2.0, -8.0, 4.0));
        assert!((far - Vec3::new(0.25, -1.0, 0.5) * 0.999).length() < 1e-6 && around.contains(far), "{far}");
        assert!(cube.contains(Vec3::ZERO) && !cube.contains(Vec3::splat(2.0)) && !cube.contains(Vec3::NAN));
    }
}
