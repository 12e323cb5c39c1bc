use std::f32::consts::FRAC_1_PI;

use lo_bsdf::{DIELECTRIC_F0, Ggx, schlick_weight};
use lo_geometry::Vec3;

/// Colourless material of a sphere, with the parameters of Blender 3.6's Principled BSDF.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Material {
    /// A perfect mirror.
    Mirror {
        /// Reflectance at normal incidence.
        reflectance: f32,
    },
    /// A rough metal: GGX with α = roughness², Smith's masking, Schlick's Fresnel term.
    Metal {
        /// Reflectance at normal incidence.
        reflectance: f32,
        /// Perceptual roughness.
        roughness: f32,
    },
    /// Burley's diffuse (2012) plus a GGX layer of reflectance 0.04 (Principled's `specular` 0.5).
    ///
    /// The layer does not attenuate the diffuse part.
    Plastic {
        /// Base colour.
        albedo: f32,
        /// Perceptual roughness of both parts.
        roughness: f32,
    },
    /// Lambertian diffuse.
    Diffuse {
        /// Albedo.
        albedo: f32,
    },
}

impl Material {
    /// Returns the diffuse part of the BRDF times the cosine of the light direction, per steradian.
    ///
    /// Unit vectors; `view` and `light` point away from the surface.
    pub(super) fn diffuse(self, normal: Vec3, view: Vec3, light: Vec3) -> f32 {
        let (n_l, n_v) = (normal.dot(light), normal.dot(view));
        if n_l <= 0.0 || n_v <= 0.0 {
            return 0.0;
        }
        match self {
            Self::Diffuse { albedo } => albedo * FRAC_1_PI * n_l,
            Self::Plastic { albedo, roughness } => {
                let half = (view + light).normalize_or(normal);
                let retro = 2.0 * roughness * half.dot(light).powi(2) - 0.5;
                let side = |cosine: f32| 1.0 + retro * schlick_weight(cosine);
                albedo * FRAC_1_PI * n_l * side(n_l) * side(n_v)
            }
            Self::Mirror { .. } | Self::Metal { .. } => 0.0,
        }
    }

    /// Returns the glossy part of the BRDF times the cosine of the light direction, per steradian; 0 for a mirror.
    pub(super) fn glossy(self, normal: Vec3, view: Vec3, light: Vec3) -> f32 {
        let (f0, roughness) = match self {
            Self::Metal { reflectance, roughness } => (reflectance, roughness),
            Self::Plastic { roughness, .. } => (DIELECTRIC_F0, roughness),
            Self::Mirror { .. } | Self::Diffuse { .. } => return 0.0,
        };
        if normal.dot(view) <= 0.0 {
            return 0.0;
        }
        let (specular, v_dot_h) = Ggx::from_roughness(roughness).reflection_cos(normal, view, light);
        specular * reflectance(f0, v_dot_h)
    }

    /// Returns the reflectance of a mirror at this cosine of the view angle; 0 for other materials.
    pub(super) fn mirror_reflectance(self, n_v: f32) -> f32 {
        match self {
            Self::Mirror { reflectance: f0 } => reflectance(f0, n_v),
            Self::Metal { .. } | Self::Plastic { .. } | Self::Diffuse { .. } => 0.0,
        }
    }
}

/// Returns Schlick's Fresnel reflectance.
fn reflectance(f0: f32, cosine: f32) -> f32 {
    f0 + (1.0 - f0) * schlick_weight(cosine)
}
