//! How surfaces scatter light: the metallic-roughness model of glTF 2.0 (appendix B.3), a GGX layer over Lambert's diffuse one.
//!
//! - [`Ggx`]: the distribution of microfacets with Smith's masking, its samples and their density.
//! - [`fresnel`]: Schlick's Fresnel term; [`specular_cos`]: the layer's BRDF with it.
//! - [`specular_albedo`], [`mean_specular_albedo`], [`transmitted`]: what the layer reflects of even light, and what passes it.
//! - [`MetallicRoughness`]: a surface point's parameters from a material's.
//! - [`pane_reflectance`]: a thin clear sheet.
//!
//! Directions are unit vectors that point away from the surface. Local frames have the normal as +Z. Roughness is perceptual,
//! GGX's α is its square. The diffuse layer is left to the user: insertion takes glTF's, which lets [`transmitted`] through,
//! light transport what [`specular_albedo`] leaves, so that nothing is lost between the two.

mod albedo;
mod fresnel;
mod ggx;
mod metallic_roughness;
mod pane;

pub use albedo::{MIRROR_ROUGHNESS, mean_specular_albedo, specular_albedo, transmitted};
pub use fresnel::{DIELECTRIC_F0, fresnel, grazing};
pub use ggx::{Ggx, GgxSample, MIN_COSINE};
pub use metallic_roughness::{MetallicRoughness, specular_cos};
pub use pane::{mean_pane_reflectance, pane_reflectance};
