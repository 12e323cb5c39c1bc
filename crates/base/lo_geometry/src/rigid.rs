use glam::{Quat, Vec3};
use serde::{Deserialize, Serialize};

/// A rigid transform: a rotation, then a translation. Values are named by target and source: `world_from_camera`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct RigidTransform {
    /// Rotation, a unit quaternion.
    pub rotation: Quat,
    /// Translation, in metres: the image of the origin.
    pub translation_m: Vec3,
}

impl RigidTransform {
    /// The identity transform.
    pub const IDENTITY: Self = Self { rotation: Quat::IDENTITY, translation_m: Vec3::ZERO };

    /// Transforms a point.
    #[inline]
    pub fn point(&self, point: Vec3) -> Vec3 {
        self.rotation * point + self.translation_m
    }

    /// Transforms a direction: rotates it.
    #[inline]
    pub fn direction(&self, direction: Vec3) -> Vec3 {
        self.rotation * direction
    }

    /// Returns the inverse transform.
    pub fn inverse(&self) -> Self {
        let rotation = self.rotation.inverse();
        Self { rotation, translation_m: -(rotation * self.translation_m) }
    }

    /// Composes two transforms: `a_from_b.after(&b_from_c)` is `a_from_c`.
    pub fn after(&self, first: &Self) -> Self {
        let rotation = (self.rotation * first.rotation).normalize();
        Self { rotation, translation_m: self.point(first.translation_m) }
    }
}

impl Default for RigidTransform {
    fn default() -> Self {
        Self::IDENTITY
    }
}

#[cfg(test)]
mod tests {
    use glam::Mat4;

    use super::*;

    #[test]
    fn motions_do_what_their_matrices_do() {
        let motion = |angle: f32, translation_m| RigidTransform {
            rotation: Quat::from_axis_angle(Vec3::new(1.0, 2.0, -0.5).normalize(), angle),
            translation_m,
        };
        let (a, b) = (motion(0.7, Vec3::new(1.0, -2.0, 3.0)), motion(-2.1, Vec3::new(0.3, 4.0, 0.5)));
        let matrix = |t: &RigidTransform| Mat4::from_rotation_translation(t.rotation, t.translation_m);
        let point = Vec3::new(0.2, -1.3, 2.4);
        // f32: a few roundings of numbers below 10
        let close = |x: Vec3, y: Vec3| (x - y).length() < 1e-5;
        assert!(close(a.after(&b).point(point), (matrix(&a) * matrix(&b)).transform_point3(point)));
        assert!(close(a.inverse().point(a.point(point)), point));
        assert!(close(a.direction(point), matrix(&a).transform_vector3(point)));
        assert_eq!(RigidTransform::IDENTITY.point(point), point);
    }
}
