use std::f32::consts::{PI, TAU};

use lo_geometry::{Mat3, Vec3};

use crate::objects::object::Object;
use crate::surface::observed_surfaces::Surface;
use crate::surface::receivers::PATTERNS;

/// The spherical cap of directions from a surface point that contains the whole object.
pub(crate) struct Cap {
    axis: Vec3,
    cos_half_angle: f32,
}

impl Cap {
    /// Returns the cap; `None` if it is completely below the surface.
    pub fn towards(object: &Object, surface: &Surface) -> Option<Self> {
        let offset = object.centre_m - surface.position_m;
        let (distance_m, radius_m) = (offset.length(), object.radius_m);
        let axis = offset / distance_m.max(1e-9);
        // Beyond a right angle inside of the bounding sphere, up to the whole sphere at its centre.
        let cos_half_angle = if distance_m > radius_m {
            (1.0 - (radius_m / distance_m).powi(2)).sqrt()
        } else {
            -(1.0 - (distance_m / radius_m).powi(2)).max(0.0).sqrt()
        };
        let sin_half_angle = (1.0 - cos_half_angle * cos_half_angle).max(0.0).sqrt();
        let below = cos_half_angle > 0.0 && surface.normal.dot(axis) < -sin_half_angle;
        (!below && axis.is_finite()).then_some(Self { axis, cos_half_angle })
    }

    pub fn solid_angle_sr(&self) -> f32 {
        TAU * (1.0 - self.cos_half_angle)
    }

    /// Returns an upper bound of the cap's share of the irradiance.
    pub fn share(&self, surface: &Surface) -> f32 {
        let sin = (1.0 - self.cos_half_angle * self.cos_half_angle).max(0.0).sqrt();
        self.solid_angle_sr() / PI * (surface.normal.dot(self.axis) + sin).clamp(0.0, 1.0)
    }

    /// Returns the first `count` directions of a pattern. They are spread evenly for every `count`, alone and
    /// together with those of the other patterns (R₂ sequence, Roberts 2018).
    pub fn directions(&self, count: usize, pattern: usize, normal: Vec3) -> impl Iterator<Item = Vec3> {
        // Oriented by the surface, not by the world's axes: no direction jumps while the object moves.
        let side = self.axis.cross(normal);
        let side = if side.length_squared() > 1e-6 { side.normalize() } else { self.axis.any_orthonormal_vector() };
        let basis = Mat3::from_cols(side, self.axis.cross(side), self.axis);
        let height = 1.0 - self.cos_half_angle;
        (0..count).map(move |i| {
            let k = (i * PATTERNS + pattern) as f32 + 0.5;
            let z = 1.0 - height * (k * 0.754_877_7).fract();
            let (sin, cos) = ((k * 0.569_840_3).fract() * TAU).sin_cos();
            let radius = (1.0 - z * z).max(0.0).sqrt();
            basis * Vec3::new(radius * cos, radius * sin, z)
        })
    }
}
