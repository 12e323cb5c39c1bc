use lo_geometry::Vec3;

use crate::{Material, MeshWarning, Texture};

/// A whole model: node transforms applied, all meshes in one list of triangles.
///
/// Lists per vertex have the length of `positions`, or are empty where the text says so.
#[derive(Clone, Debug, Default)]
pub struct Model {
    /// Vertex positions in metres (glTF) or file units.
    pub positions: Vec<Vec3>,
    /// Unit vertex normals.
    pub normals: Vec<Vec3>,
    /// Unit tangents with handedness in w; empty where no material has a normal texture.
    pub tangents: Vec<[f32; 4]>,
    /// Two UV sets, v down as in glTF; empty where the file has none.
    pub uvs: [Vec<[f32; 2]>; 2],
    /// Linear RGBA that multiplies the base colour; empty where the file has none.
    pub colors: Vec<[f32; 4]>,
    /// Three vertex indices per triangle, counter-clockwise seen from the front.
    pub triangles: Vec<[u32; 3]>,
    /// Material of each triangle.
    pub triangle_materials: Vec<u32>,
    /// Never empty.
    pub materials: Vec<Material>,
    /// Pictures that materials refer to.
    pub textures: Vec<Texture>,
    /// What the user should know: textures that are missing, parts left out.
    pub warnings: Vec<MeshWarning>,
}

/// How to read a mesh.
#[derive(Clone, Debug, PartialEq)]
pub struct LoadOptions {
    /// Faces that meet at less than this angle (radians) share a smooth normal, in files that bring no normals
    /// (OBJ without smoothing groups, PLY, STL; glTF without normals is flat, as its standard says).
    pub crease_angle_rad: f32,
}

impl Default for LoadOptions {
    fn default() -> Self {
        Self { crease_angle_rad: 40_f32.to_radians() }
    }
}

/// Smallest box around a model, in its own units.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bounds {
    /// Least x, y and z.
    pub min: Vec3,
    /// Greatest x, y and z.
    pub max: Vec3,
}

impl Model {
    /// Fills in the tangents that normal textures need, by Mikkelsen's tangent space; vertices where two of them meet are split. Without normal
    /// textures nothing changes.
    pub fn complete_tangents(&mut self) {
        crate::tangents::complete(self);
    }
}

impl Bounds {
    /// Middle of the box.
    pub fn center(&self) -> Vec3 {
        self.min + (self.max - self.min) * 0.5
    }

    /// Edge lengths.
    pub fn size(&self) -> Vec3 {
        self.max - self.min
    }
}

/// Fetches a file that a mesh names, by the name written in the mesh (percent signs decoded).
pub type Resolver<'a> = dyn Fn(&str) -> std::io::Result<Vec<u8>> + 'a;

impl Model {
    /// Box around all triangles.
    pub fn bounds(&self) -> Bounds {
        let none = Bounds { min: Vec3::INFINITY, max: Vec3::NEG_INFINITY };
        self.triangles.iter().flatten().fold(none, |bounds, &vertex| {
            let p = self.positions[vertex as usize];
            Bounds { min: bounds.min.min(p), max: bounds.max.max(p) }
        })
    }
}
