use glam::Vec3;

/// A ray: an origin and a unit direction.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ray {
    /// Origin, in metres.
    pub origin: Vec3,
    /// Unit direction.
    pub direction: Vec3,
}

impl Ray {
    /// Returns the point at `distance_m` along the ray.
    #[inline]
    pub fn at(&self, distance_m: f32) -> Vec3 {
        self.origin + self.direction * distance_m
    }
}
