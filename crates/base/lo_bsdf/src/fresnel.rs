//! Schlick's Fresnel term.

use lo_geometry::Vec3;

/// Reflectance of a dielectric at normal incidence (index of refraction 1.5).
pub const DIELECTRIC_F0: f32 = 0.04;

/// Schlick's Fresnel reflectance for the cosine between view and half vector; `f0` is that at normal incidence
/// (Schlick 1994, equation 15).
#[inline]
pub fn fresnel(f0: Vec3, v_dot_h: f32) -> Vec3 {
    f0 + (Vec3::ONE - f0) * schlick_weight(v_dot_h)
}

/// Interpolation weight `(1 − cos θ)⁵` of Schlick's term between the reflectance at normal incidence and 1.
#[inline]
pub fn schlick_weight(cosine: f32) -> f32 {
    let x = (1.0 - cosine).clamp(0.0, 1.0);
    let squared = x * x;
    squared * squared * x
}
