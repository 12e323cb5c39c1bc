//! Triangle meshes with metallic-roughness materials: readers for glTF, OBJ, PLY and STL, and ray intersection.

mod material;
mod model;

pub use material::{AlphaMode, Material, Texture, TextureRef};
pub use model::{Hit, Model, SurfacePoint};
