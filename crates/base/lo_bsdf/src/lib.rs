//! Surface scattering: the metallic-roughness model of glTF 2.0 (appendix B.3), a GGX layer over a Lambertian one.
//!
//! - [`Ggx`]: the microfacet distribution with Smith masking, its sampling and pdf.
//! - [`fresnel`]: Schlick's Fresnel term; [`specular_cos`]: the specular layer's BRDF.
//! - [`specular_albedo`], [`mean_specular_albedo`], [`specular_transmittance`]: the shares of uniform light that the
//!   layer reflects and transmits.
//! - [`MetallicRoughness`]: a surface point's BSDF parameters from a material's.
//! - [`pane_reflectance`]: a thin sheet of clear glass.
//! - [`sheen_albedo`]: the share of uniform light that a layer of sheen reflects.
//! - [`dielectric_reflectance`], [`refracted`]: a smooth boundary between two dielectrics.
//!
//! Directions are unit vectors that point away from the surface. Local frames have the normal as +Z. Roughness is
//! perceptual: GGX's α is its square.
//!
//! Callers choose the diffuse layer. Insertion uses glTF's, which receives [`specular_transmittance`]. Light transport
//! uses the remainder of [`specular_albedo`], so that energy is conserved between the two layers.

mod albedo;
mod dielectric;
mod fresnel;
mod ggx;
mod metallic_roughness;
mod pane;
mod sheen;

pub use albedo::{MIRROR_ROUGHNESS, mean_specular_albedo, specular_albedo, specular_transmittance};
pub use dielectric::{GLASS_IOR, dielectric_f0, dielectric_reflectance, refracted};
pub use fresnel::{DIELECTRIC_F0, fresnel, schlick_weight};
pub use ggx::{Ggx, GgxSample, MIN_COSINE};
pub use metallic_roughness::{MetallicRoughness, specular_cos};
pub use pane::{mean_pane_reflectance, pane_reflectance};
pub use sheen::sheen_albedo;
