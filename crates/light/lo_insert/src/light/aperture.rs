//! Apertures of cones that represent a solid angle.

use std::f32::consts::TAU;

/// Returns the tangent of the half-angle of a cone of the given solid angle, at most 120° across.
pub(crate) fn cone_tangent(solid_angle_sr: f32) -> f32 {
    let cos = (1.0 - solid_angle_sr / TAU).max(0.5);
    ((1.0 - cos * cos).max(0.0)).sqrt() / cos
}

/// Rounds a tangent to quarter octaves: cones of one tangent share their steps.
pub(crate) fn quantised(tangent: f32) -> f32 {
    ((4.0 * tangent.max(1e-4).log2()).round() / 4.0).exp2()
}
