//! Scattering of surfaces in the exchange of diffuse light: the mean over directions, including rough gloss. Smooth
//! gloss is traced along the mirrored ray.

use lo_bsdf::{DIELECTRIC_F0, mean_pane_reflectance, mean_specular_albedo, pane_reflectance, specular_albedo};
use lo_geometry::Vec3;

use crate::traced_world::SurfaceInteraction;

/// Metals smoother than this reflect along a ray. Rougher gloss counts as diffuse.
const SMOOTH_ROUGHNESS: f32 = 0.3;

/// Scattering averaged over all directions.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct MeanScattering {
    /// Share of irradiance that leaves on the same side.
    pub same_side: Vec3,
    /// Share of the other side's irradiance that leaves here.
    pub through: Vec3,
    /// Total reflected share, including mirrors.
    pub reflected: Vec3,
}

/// Computes the means from a surface seen along its normal.
pub(crate) fn mean_scattering(surface: &SurfaceInteraction) -> MeanScattering {
    let dielectric = Vec3::splat(DIELECTRIC_F0);
    let (at_normal, mean) = if surface.pane {
        (pane_reflectance(1.0), mean_pane_reflectance())
    } else {
        let seen = specular_albedo(dielectric, surface.roughness, 1.0).x;
        (seen, mean_specular_albedo(dielectric, surface.roughness).x)
    };
    let less = (1.0 - mean) / (1.0 - at_normal);
    let gloss = mean_specular_albedo(surface.f0, surface.roughness) * surface.coverage;
    let gloss = if surface.is_glossy() { gloss } else { Vec3::ZERO };
    let diffuse = surface.diffuse * less;
    let same_side = diffuse + if follows_ray(surface) { Vec3::ZERO } else { gloss };
    MeanScattering { same_side, through: surface.through * less, reflected: diffuse + gloss + surface.mirror }
}

/// Whether the gloss is traced along a ray.
pub(crate) fn follows_ray(surface: &SurfaceInteraction) -> bool {
    surface.is_glossy() && surface.roughness < SMOOTH_ROUGHNESS && surface.f0.max_element() > 0.2
}

/// Returns the shares of light that come straight from behind and from the mirrored direction.
pub(crate) fn rays(surface: &SurfaceInteraction) -> [Vec3; 2] {
    let gloss = if follows_ray(surface) {
        let cosine = surface.normal.dot(surface.view);
        specular_albedo(surface.f0, surface.roughness, cosine) * surface.coverage
    } else {
        Vec3::ZERO
    };
    [surface.pass, surface.mirror + gloss]
}
