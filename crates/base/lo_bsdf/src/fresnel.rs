//! Schlick's Fresnel term.

use lo_geometry::Vec3;

/// Reflectance of a dielectric at normal incidence (index of refraction 1.5).
pub const DIELECTRIC_F0: f32 = 0.04;

/// Reflectance for the cosine between view and half vector, given that at normal incidence (Schlick 1994, equation 15).
#[inline]
pub fn fresnel(f0: Vec3, v_dot_h: f32) -> Vec3 {
    f0 + (Vec3::ONE - f0) * grazing(v_dot_h)
}

/// Share by which Schlick's term has gone from the reflectance at normal incidence to 1: `(1 − cos θ)⁵`.
#[inline]
pub fn grazing(cosine: f32) -> f32 {
    let x = (1.0 - cosine).clamp(0.0, 1.0);
    let squared = x * x;
    squared * squared * x
}
