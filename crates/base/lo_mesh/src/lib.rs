//! Triangle meshes with metallic-roughness materials: readers for glTF, OBJ, PLY and STL, and ray intersection.

mod bvh;
mod error;
mod glassware;
mod glb;
mod gltf;
mod lathe;
mod load;
mod material;
mod model;
mod normals;
mod obj;
mod placed;
mod ply;
mod polygon;
mod prepared;
mod preset;
mod repair;
mod sah;
mod sphere;
mod stl;
mod surface;
mod tangents;
mod texture;
mod triangle;
mod warning;

pub use error::MeshError;
pub use glb::{GlbTooLarge, GlbWriter};
pub use gltf::{GlbScene, GlbSun};
pub use material::{AlphaMode, Material, TextureRef, Volume, Wrap};
pub use model::{Bounds, LoadOptions, Model, Resolver};
pub use placed::{PlacedModel, Placement};
pub use prepared::{Hit, PreparedModel, offset_origin};
pub use preset::{AlphaModeName, Color, MaterialSpec};
pub use surface::SurfacePoint;
pub use texture::Texture;
pub use warning::MeshWarning;
