use lo_geometry::Vec3;

use crate::{Material, MeshWarning, Texture};

/// A triangle model: all meshes of a file in one list, with node transforms applied.
///
/// Vertex attributes have the length of `positions`; optional ones may be empty.
#[derive(Clone, Debug, Default)]
pub struct Model {
    /// Vertex positions in metres (glTF) or file units.
    pub positions: Vec<Vec3>,
    /// Unit vertex normals.
    pub normals: Vec<Vec3>,
    /// Unit tangents with handedness in w; empty if no material has a normal texture.
    pub tangents: Vec<[f32; 4]>,
    /// Two UV sets, v down as in glTF; empty if the file has none.
    pub uvs: [Vec<[f32; 2]>; 2],
    /// Linear RGBA that multiplies the base colour; empty if the file has none.
    pub colors: Vec<[f32; 4]>,
    /// Three vertex indices per triangle, counter-clockwise seen from the front.
    pub triangles: Vec<[u32; 3]>,
    /// Material index of each triangle.
    pub triangle_materials: Vec<u32>,
    /// Materials; never empty.
    pub materials: Vec<Material>,
    /// Textures that materials refer to.
    pub textures: Vec<Texture>,
    /// Warnings for the user: missing textures, ignored parts.
    pub warnings: Vec<MeshWarning>,
}

/// Options for reading a mesh.
#[derive(Clone, Debug, PartialEq)]
pub struct LoadOptions {
    /// Angle in radians below which adjacent faces share a smooth normal, in files without normals.
    ///
    /// Applies to OBJ without smoothing groups, PLY and STL. glTF without normals is flat, as required by its
    /// specification.
    pub crease_angle_rad: f32,
}

impl Default for LoadOptions {
    fn default() -> Self {
        Self { crease_angle_rad: 40_f32.to_radians() }
    }
}

/// Axis-aligned bounding box of a model, in model units.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bounds {
    /// Least x, y and z.
    pub min: Vec3,
    /// Greatest x, y and z.
    pub max: Vec3,
}

impl Bounds {
    /// Centre of the box.
    pub fn center(&self) -> Vec3 {
        self.min + (self.max - self.min) * 0.5
    }

    /// Edge lengths.
    pub fn size(&self) -> Vec3 {
        self.max - self.min
    }
}

/// Reads a file that a mesh refers to, by the name in the mesh (with percent-encoding decoded).
pub type Resolver<'a> = dyn Fn(&str) -> std::io::Result<Vec<u8>> + 'a;

impl Model {
    /// Bounding box of all triangles.
    pub fn bounds(&self) -> Bounds {
        let none = Bounds { min: Vec3::INFINITY, max: Vec3::NEG_INFINITY };
        self.triangles.iter().flatten().fold(none, |bounds, &vertex| {
            let p = self.positions[vertex as usize];
            Bounds { min: bounds.min.min(p), max: bounds.max.max(p) }
        })
    }

    /// Returns the volume inside a closed model that faces outwards.
    #[cfg(test)]
    pub(crate) fn volume(&self) -> f32 {
        let corner = |v: u32| self.positions[v as usize];
        self.triangles.iter().map(|&[a, b, c]| corner(a).cross(corner(b)).dot(corner(c)) / 6.0).sum()
    }
}
