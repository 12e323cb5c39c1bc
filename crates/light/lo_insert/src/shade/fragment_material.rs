use lo_bsdf::{DIELECTRIC_F0, MetallicRoughness};
use lo_geometry::Vec3;
use lo_mesh::SurfacePoint;

/// BSDF of a fragment, with the kinds of light that it needs.
pub(crate) struct FragmentMaterial {
    pub bsdf: MetallicRoughness,
    /// Whether its reflection is faint and blurred enough to be interpolated from nearby pixels.
    pub shares_reflection: bool,
    /// Whether it reflects diffusely.
    pub diffuse: bool,
    /// Whether light samples make highlights on it.
    pub gloss: bool,
}

/// Returns the BSDF of a surface point, without its clear coat.
pub(crate) fn bsdf_of(point: &SurfacePoint) -> MetallicRoughness {
    let (base_color, f0) = (Vec3::from(point.base_color), Vec3::from(point.dielectric_f0));
    MetallicRoughness::new(base_color, point.metallic, point.roughness, f0)
}

/// Returns the BSDF of the clear coat of a surface point.
pub(crate) fn coat_of(point: &SurfacePoint) -> MetallicRoughness {
    MetallicRoughness { diffuse: Vec3::ZERO, f0: Vec3::splat(DIELECTRIC_F0), roughness: point.clearcoat_roughness }
}

impl FragmentMaterial {
    /// Returns whether light gathered for one of two fragments is valid for the other.
    pub fn is_like(&self, other: &Self) -> bool {
        self.shares_reflection == other.shares_reflection && self.diffuse == other.diffuse && self.gloss == other.gloss
    }

    /// Returns whether it needs gathered light.
    pub fn gathers(&self) -> bool {
        self.diffuse || self.gloss
    }
}
