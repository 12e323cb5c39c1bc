use geometry::Vec3;

use crate::{Material, Texture};

/// A whole model: node transforms applied, all meshes in one list of triangles.
#[derive(Clone, Debug)]
pub struct Model {
    /// Vertex positions in metres (glTF) or file units.
    pub positions: Vec<Vec3>,
    /// Unit vertex normals.
    pub normals: Vec<Vec3>,
    /// Tangents with handedness in w; empty where no material has a normal texture.
    pub tangents: Vec<[f32; 4]>,
    /// Two UV sets per vertex.
    pub uvs: [Vec<[f32; 2]>; 2],
    /// Three vertex indices per triangle.
    pub triangles: Vec<[u32; 3]>,
    /// Material of each triangle.
    pub triangle_materials: Vec<u32>,
    /// Never empty.
    pub materials: Vec<Material>,
    /// Pictures that materials refer to.
    pub textures: Vec<Texture>,
}

/// Where a ray meets a model.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hit {
    /// Distance along the ray in metres.
    pub distance_m: f32,
    /// Triangle index.
    pub triangle: u32,
    /// Barycentric weights of the second and third vertex.
    pub barycentric: [f32; 2],
}

/// Material and shading frame at a point of a model.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SurfacePoint {
    /// Position.
    pub position: Vec3,
    /// Unit normal of the triangle, towards the viewer.
    pub geometric_normal: Vec3,
    /// Unit normal from vertex normals and normal texture, towards the viewer.
    pub shading_normal: Vec3,
    /// Linear RGB.
    pub base_color: [f32; 3],
    /// Coverage in [0, 1], by the material's alpha mode.
    pub alpha: f32,
    /// 0 … 1.
    pub metallic: f32,
    /// Perceptual roughness, 0 … 1.
    pub roughness: f32,
    /// Ambient occlusion, 0 … 1.
    pub occlusion: f32,
    /// Linear RGB radiance given off.
    pub emissive: [f32; 3],
    /// Base colour is shown as it is.
    pub unlit: bool,
}
