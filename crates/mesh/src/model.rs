use std::path::{Path, PathBuf};

use geometry::Vec3;

use crate::{GlbTooLarge, Material, MeshError, Texture, gltf, normals, obj, ply, repair, stl, tangents};

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
    pub warnings: Vec<String>,
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
    /// Reads glTF 2.0 (`.gltf`, `.glb`), Wavefront OBJ (with its MTL), PLY or STL. The extension chooses the
    /// format; without a known one the first bytes do. Files named inside the mesh lie beside it.
    ///
    /// # Errors
    /// See [`MeshError`]; all of them name the file. Missing textures are no error: see [`Model::warnings`].
    pub fn load(path: impl AsRef<Path>, options: &LoadOptions) -> Result<Self, MeshError> {
        let path = path.as_ref();
        let bytes = std::fs::read(path).map_err(|source| MeshError::Io { path: path.to_owned(), source })?;
        let folder = path.parent().map(Path::to_owned).unwrap_or_default();
        let resolve = |name: &str| read_file(&folder.join(local_path(name)));
        let extension = path.extension().and_then(|e| e.to_str()).unwrap_or_default().to_ascii_lowercase();
        let model = match extension.as_str() {
            "gltf" | "glb" => Self::from_gltf_bytes(&bytes, &resolve),
            "obj" => Self::from_obj_bytes(&bytes, &resolve, options),
            "ply" => Self::from_ply_bytes(&bytes, options),
            "stl" => Self::from_stl_bytes(&bytes, options),
            _ if bytes.starts_with(b"glTF") || bytes.trim_ascii_start().starts_with(b"{") => {
                Self::from_gltf_bytes(&bytes, &resolve)
            }
            _ if bytes.starts_with(b"ply") => Self::from_ply_bytes(&bytes, options),
            _ if bytes.starts_with(b"solid") => Self::from_stl_bytes(&bytes, options),
            _ => Err(MeshError::UnknownFormat),
        };
        model.map_err(|source| MeshError::InFile { path: path.to_owned(), source: Box::new(source) })
    }

    /// Reads glTF JSON or GLB. All triangle primitives of the default scene (of all scenes where none is the
    /// default), with node transforms; skins and animations in their bind pose.
    ///
    /// # Errors
    /// See [`MeshError`].
    pub fn from_gltf_bytes(bytes: &[u8], resolve: &Resolver) -> Result<Self, MeshError> {
        gltf::read(bytes, resolve)?.finish()
    }

    /// Reads OBJ text and the MTL files that it names.
    ///
    /// # Errors
    /// See [`MeshError`].
    pub fn from_obj_bytes(bytes: &[u8], resolve: &Resolver, options: &LoadOptions) -> Result<Self, MeshError> {
        obj::read(bytes, resolve, options)?.finish()
    }

    /// Reads PLY, ASCII or binary of either byte order.
    ///
    /// # Errors
    /// See [`MeshError`].
    pub fn from_ply_bytes(bytes: &[u8], options: &LoadOptions) -> Result<Self, MeshError> {
        ply::read(bytes, options)?.finish()
    }

    /// Reads STL, ASCII or binary. Equal positions become one vertex.
    ///
    /// # Errors
    /// See [`MeshError`].
    pub fn from_stl_bytes(bytes: &[u8], options: &LoadOptions) -> Result<Self, MeshError> {
        stl::read(bytes, options)?.finish()
    }

    /// A model of one material from bare triangles; normals are smooth up to the crease angle.
    ///
    /// # Errors
    /// Indices beyond the vertices, no usable triangle.
    pub fn from_triangles(
        positions: Vec<Vec3>,
        triangles: Vec<[u32; 3]>,
        material: Material,
        options: &LoadOptions,
    ) -> Result<Self, MeshError> {
        repair::check_indices(&triangles, positions.len())?;
        let smooth = normals::smooth(&positions, &triangles, options.crease_angle_rad, |_| None);
        let model = Self {
            positions: smooth.vertex_positions.iter().map(|&p| positions[p as usize]).collect(),
            normals: smooth.vertex_normals,
            triangle_materials: vec![0; smooth.triangles.len()],
            triangles: smooth.triangles,
            materials: vec![material],
            ..Self::default()
        };
        model.finish()
    }

    /// The model as glTF 2.0 binary: textures inside as PNG, radiance above 1 by `KHR_materials_emissive_strength`, panes and cloth by
    /// `KHR_materials_transmission` and `KHR_materials_diffuse_transmission`. Vertices that no triangle uses are left out.
    ///
    /// # Errors
    /// A file of more than 4 GiB.
    pub fn to_glb(&self) -> Result<Vec<u8>, GlbTooLarge> {
        gltf::write(self, imaging::generator())
    }

    /// Box around all triangles.
    pub fn bounds(&self) -> Bounds {
        let none = Bounds { min: Vec3::INFINITY, max: Vec3::NEG_INFINITY };
        self.triangles.iter().flatten().fold(none, |bounds, &vertex| {
            let p = self.positions[vertex as usize];
            Bounds { min: bounds.min.min(p), max: bounds.max.max(p) }
        })
    }

    /// Brings a freshly read model into the state that the fields promise.
    fn finish(mut self) -> Result<Self, MeshError> {
        if self.materials.is_empty() {
            self.materials.push(Material::default());
        }
        repair::repair(&mut self)?;
        tangents::complete(&mut self);
        Ok(self)
    }
}

/// Reads a file that a mesh names. It may name anything: devices and pipes need not have an end.
fn read_file(path: &Path) -> std::io::Result<Vec<u8>> {
    if std::fs::metadata(path)?.is_file() {
        std::fs::read(path)
    } else {
        Err(std::io::Error::other("it is no regular file"))
    }
}

/// The name of a neighbouring file as a path: Windows separators turned, no scheme.
fn local_path(name: &str) -> PathBuf {
    PathBuf::from(name.replace('\\', "/"))
}
