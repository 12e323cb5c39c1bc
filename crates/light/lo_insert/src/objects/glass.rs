//! Transmissive surfaces: thin panes, through which light passes straight, and solids, which refract it.
//!
//! Camera rays follow refraction (`shade::refraction`). Light rays to other surfaces pass glass straight: it dims and
//! tints them, so that its shadow is bright, but it does not focus them.

use lo_bsdf::{dielectric_reflectance, fresnel};
use lo_geometry::Vec3;
use lo_mesh::{Material, SurfacePoint, Volume};

/// Smallest share of transmission for which light rays pass a surface; others block them.
const MIN_PASSING: f32 = 0.5;

/// Perceptual roughness up to which a pane shows the photo's own pixels, instead of blurring what is behind it.
const CLEAR_ROUGHNESS: f32 = 0.15;

/// How the camera sees what is behind a surface.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Sight {
    /// Not at all, or through its coverage.
    Opaque,
    /// Through a clear pane: the photo's pixels show through.
    Pane,
    /// By rays that are refracted or blurred.
    Traced,
}

/// Returns how the camera sees through a surface.
pub(crate) fn sight(point: &SurfacePoint) -> Sight {
    match point.volume {
        _ if transmission(point) == 0.0 => Sight::Opaque,
        None if point.roughness <= CLEAR_ROUGHNESS => Sight::Pane,
        _ => Sight::Traced,
    }
}

/// Returns the share of the light from behind that does not pass a pane, seen from the unit direction `view`.
///
/// It is above 0: glass reflects. Tinted glass dims light of all colours alike, by the luminance of its base colour.
pub(crate) fn blocked_share(point: &SurfacePoint, view: Vec3) -> f32 {
    let tint = lo_imaging::luminance(point.base_color).clamp(0.0, 1.0);
    1.0 - transmission(point) * (1.0 - pane_reflectance(point, view)) * tint
}

/// Returns the share of diffuse reflection that transmission leaves.
pub(crate) fn diffuse_share(point: &SurfacePoint) -> f32 {
    1.0 - transmission(point)
}

/// Returns the share of the light not reflected at a surface that passes it. Metals and unlit surfaces transmit
/// nothing.
pub(crate) fn transmission(point: &SurfacePoint) -> f32 {
    if point.unlit { 0.0 } else { (point.transmission * (1.0 - point.metallic)).clamp(0.0, 1.0) }
}

/// Returns whether a surface lets light rays pass.
pub(crate) fn lets_light_pass(point: &SurfacePoint) -> bool {
    transmission(point) >= MIN_PASSING
}

/// Returns whether a material lets light rays pass everywhere.
pub(crate) fn always_lets_light_pass(material: &Material) -> bool {
    let metallic = if material.metallic_roughness_texture.is_some() { 1.0 } else { material.metallic };
    !material.unlit && material.transmission * (1.0 - metallic) >= MIN_PASSING
}

/// Light of a straight ray through glass.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Passed {
    /// Share of the light that arrives, linear RGB.
    pub share: Vec3,
    /// Share that would arrive if the glass had no colour.
    pub clear: f32,
    /// The interior that the ray is in, and where it entered.
    inside: Option<(Volume, f32)>,
}

impl Passed {
    /// A ray that has met nothing.
    pub const ALL: Self = Self { share: Vec3::ONE, clear: 1.0, inside: None };

    /// Crosses a surface at a distance along the ray, seen from the unit direction `view`.
    pub fn cross(&mut self, point: &SurfacePoint, view: Vec3, distance_m: f32) {
        let tint = transmission(point) * Vec3::from(point.base_color);
        let Some(volume) = point.volume else {
            let clear = 1.0 - pane_reflectance(point, view);
            self.clear *= clear;
            self.share *= clear * tint;
            return;
        };
        // Straight rays have the same angle on both sides; it is the one outside.
        let cosine = point.shading_normal.dot(view).clamp(0.0, 1.0);
        let clear = 1.0 - dielectric_reflectance(cosine, point.ior);
        self.clear *= clear;
        self.share *= clear;
        if point.is_front {
            self.share *= tint;
            self.inside = Some((volume, distance_m));
        } else {
            let (volume, entered_m) = self.inside.take().unwrap_or((volume, 0.0));
            self.share *= Vec3::from(volume.transmittance(distance_m - entered_m));
        }
    }
}

/// Reflectance of one face of thin glass.
fn pane_reflectance(point: &SurfacePoint, view: Vec3) -> f32 {
    let f0 = Vec3::splat(lo_imaging::luminance(point.dielectric_f0));
    fresnel(f0, point.shading_normal.dot(view).clamp(0.0, 1.0)).x
}
