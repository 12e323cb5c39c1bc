use std::f32::consts::FRAC_1_PI;

use lo_bsdf::{DIELECTRIC_F0, Ggx, schlick_weight};
use lo_geometry::Vec3;

/// What a sphere is made of, as Blender 3.6's Principled BSDF takes it; colourless.
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
    /// Burley's diffuse (2012) under a GGX layer with the reflectance 0.04 (Principled's `specular` 0.5), which takes nothing from what is below it.
    Plastic {
        /// Base colour.
        albedo: f32,
        /// Perceptual roughness of both.
        roughness: f32,
    },
    /// Lambert's.
    Diffuse {
        /// Albedo.
        albedo: f32,
    },
}

impl Material {
    /// The broad part of the BRDF times the cosine of the light direction, per steradian; unit vectors, `view` and `light` away from the surface.
    pub(super) fn broad(self, normal: Vec3, view: Vec3, light: Vec3) -> f32 {
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

    /// The glossy part of the BRDF times the cosine of the light direction, per steradian; a mirror has none that could be stated.
    pub(super) fn glossy(self, normal: Vec3, view: Vec3, light: Vec3) -> f32 {
        let (f0, roughness) = match self {
            Self::Metal { reflectance, roughness } => (reflectance, roughness),
            Self::Plastic { roughness, .. } => (DIELECTRIC_F0, roughness),
            Self::Mirror { .. } | Self::Diffuse { .. } => return 0.0,
        };
        if normal.dot(view) <= 0.0 {
            return 0.0;
        }
        let (mirrors, v_dot_h) = Ggx::from_roughness(roughness).reflection_cos(normal, view, light);
        mirrors * reflectance(f0, v_dot_h)
    }

    /// Reflectance of a mirror seen under this cosine.
    pub(super) fn mirrored(self, n_v: f32) -> f32 {
        match self {
            Self::Mirror { reflectance: f0 } => reflectance(f0, n_v),
            Self::Metal { .. } | Self::Plastic { .. } | Self::Diffuse { .. } => 0.0,
        }
    }
}

/// Schlick's Fresnel term of a colourless surface.
fn reflectance(f0: f32, cosine: f32) -> f32 {
    f0 + (1.0 - f0) * schlick_weight(cosine)
}
