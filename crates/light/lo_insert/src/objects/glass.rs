//! Transmissive surfaces, as thin panes: light passes straight through and is not refracted.

use lo_bsdf::schlick_weight;
use lo_geometry::Vec3;
use lo_mesh::SurfacePoint;

/// Reflectance of glass at normal incidence.
const F0: f32 = 0.04;

/// Returns the share of the light from behind that does not pass a surface, seen from the unit direction `view`.
///
/// It is above 0: glass reflects. Tinted glass dims light of all colours alike, by the luminance of its base colour.
pub(crate) fn blocked_share(point: &SurfacePoint, view: Vec3) -> f32 {
    let reflected = F0 + (1.0 - F0) * schlick_weight(point.shading_normal.dot(view).clamp(0.0, 1.0));
    let tint = lo_imaging::luminance(point.base_color).clamp(0.0, 1.0);
    1.0 - transmission(point) * (1.0 - reflected) * tint
}

/// Returns the share of diffuse reflection that transmission leaves.
pub(crate) fn diffuse_share(point: &SurfacePoint) -> f32 {
    1.0 - transmission(point)
}

/// Metals and unlit surfaces transmit nothing.
fn transmission(point: &SurfacePoint) -> f32 {
    if point.unlit { 0.0 } else { (point.transmission * (1.0 - point.metallic)).clamp(0.0, 1.0) }
}
