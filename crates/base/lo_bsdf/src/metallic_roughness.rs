//! BSDF parameters of a metallic-roughness surface.

use lo_geometry::Vec3;

use crate::fresnel::fresnel;
use crate::ggx::Ggx;

/// BSDF parameters of one surface point.
#[derive(Clone, Copy, Debug)]
pub struct MetallicRoughness {
    /// Diffuse albedo below the specular layer, linear RGB.
    pub diffuse: Vec3,
    /// Specular reflectance at normal incidence, linear RGB.
    pub f0: Vec3,
    /// Perceptual roughness.
    pub roughness: f32,
}

impl MetallicRoughness {
    /// Converts base colour, metalness, perceptual roughness, and the reflectance at normal incidence where it is not
    /// metal ([`dielectric_f0`](crate::dielectric_f0)), each in [0, 1].
    pub fn new(base_color: Vec3, metallic: f32, roughness: f32, dielectric_f0: Vec3) -> Self {
        Self { diffuse: base_color * (1.0 - metallic), f0: dielectric_f0.lerp(base_color, metallic), roughness }
    }

    /// Returns the microfacet distribution.
    #[inline]
    pub fn ggx(&self) -> Ggx {
        Ggx::from_roughness(self.roughness)
    }
}

/// BRDF of the specular GGX layer times the light's cosine, per steradian (see [`Ggx::reflection_cos`]).
#[inline]
pub fn specular_cos(f0: Vec3, ggx: Ggx, normal: Vec3, view: Vec3, light: Vec3) -> Vec3 {
    let (reflection, v_dot_h) = ggx.reflection_cos(normal, view, light);
    fresnel(f0, v_dot_h) * reflection
}
