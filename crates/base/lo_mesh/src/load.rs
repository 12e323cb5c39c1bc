use std::path::{Path, PathBuf};

use lo_geometry::Vec3;
use lo_imaging::read_regular_file;

use crate::model::Resolver;
use crate::{
    GlbScene, GlbTooLarge, LoadOptions, Material, MeshError, MeshWarning, Model, gltf, normals, obj, ply, repair, stl,
    tangents,
};

/// Longest mesh file, and file that a mesh refers to, bytes.
pub(crate) const MAX_FILE_BYTES: u64 = 4 << 30;

impl Model {
    /// Reads glTF 2.0 (`.gltf`, `.glb`), Wavefront OBJ (with its MTL), PLY or STL.
    ///
    /// The format is chosen by extension, else by the first bytes. Names of other files are relative to the mesh's
    /// folder.
    ///
    /// # Errors
    /// [`MeshError`], naming the file; also for devices, pipes and files of more than 4 GiB. Missing textures are
    /// warnings: see [`Model::warnings`].
    pub fn load(path: impl AsRef<Path>, options: &LoadOptions) -> Result<Self, MeshError> {
        let path = path.as_ref();
        let bytes = read_regular_file(path, MAX_FILE_BYTES)
            .map_err(|source| MeshError::Io { path: path.to_owned(), source })?;
        let folder = path.parent().map(Path::to_owned).unwrap_or_default();
        let resolve = |name: &str| read_file(&folder.join(local_path(name)));
        Self::from_bytes(path, &bytes, &resolve, options)
    }

    /// Like [`Model::load`], from memory. `name` is the file's name, and `resolve` reads the files that it refers to.
    ///
    /// # Errors
    /// As for [`Model::load`].
    pub fn from_bytes(
        name: impl AsRef<Path>,
        bytes: &[u8],
        resolve: &Resolver,
        options: &LoadOptions,
    ) -> Result<Self, MeshError> {
        let name = name.as_ref();
        let extension = name.extension().and_then(|e| e.to_str()).unwrap_or_default().to_ascii_lowercase();
        let model = match extension.as_str() {
            "gltf" | "glb" => Self::from_gltf_bytes(bytes, resolve),
            "obj" => Self::from_obj_bytes(bytes, resolve, options),
            "ply" => Self::from_ply_bytes(bytes, options),
            "stl" => Self::from_stl_bytes(bytes, options),
            _ if bytes.starts_with(b"glTF") || bytes.trim_ascii_start().starts_with(b"{") => {
                Self::from_gltf_bytes(bytes, resolve)
            }
            _ if bytes.starts_with(b"ply") => Self::from_ply_bytes(bytes, options),
            _ if bytes.starts_with(b"solid") => Self::from_stl_bytes(bytes, options),
            _ => Err(MeshError::UnknownFormat),
        };
        model.map_err(|source| MeshError::InFile { path: name.to_owned(), source: Box::new(source) })
    }

    /// Reads glTF JSON or GLB.
    ///
    /// Reads all triangle primitives of the default scene (of all scenes without a default), with node transforms.
    /// Skins and morph targets are applied at rest; [`AnimatedModel`](crate::AnimatedModel) plays animations.
    ///
    /// # Errors
    /// See [`MeshError`].
    pub fn from_gltf_bytes(bytes: &[u8], resolve: &Resolver) -> Result<Self, MeshError> {
        gltf::read(bytes, resolve)?.finish()
    }

    /// Reads OBJ text and the MTL files that it refers to.
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

    /// Reads STL, ASCII or binary. Equal positions are merged to one vertex.
    ///
    /// # Errors
    /// See [`MeshError`].
    pub fn from_stl_bytes(bytes: &[u8], options: &LoadOptions) -> Result<Self, MeshError> {
        stl::read(bytes, options)?.finish()
    }

    /// Creates a model of one material from triangles; normals are smooth up to the crease angle.
    ///
    /// # Errors
    /// [`MeshError`] for indices out of range, or without any usable triangle.
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

    /// Encodes the model as binary glTF 2.0; `generator` is the name of the writing program.
    ///
    /// Textures are embedded as PNG. Radiance above 1 uses `KHR_materials_emissive_strength`, panes and cloth use
    /// `KHR_materials_transmission` and `KHR_materials_diffuse_transmission`. Unused vertices are omitted.
    ///
    /// # Errors
    /// [`GlbTooLarge`] for a file of more than 4 GiB.
    pub fn to_glb(&self, generator: &str) -> Result<Vec<u8>, GlbTooLarge> {
        self.to_glb_scene(generator, &GlbScene::default())
    }

    /// Like [`to_glb`](Self::to_glb), with a mesh for each object, cameras and the sun.
    ///
    /// # Errors
    /// [`GlbTooLarge`] for a file of more than 4 GiB.
    ///
    /// # Panics
    /// If an object has a triangle index out of range.
    pub fn to_glb_scene(&self, generator: &str, scene: &GlbScene) -> Result<Vec<u8>, GlbTooLarge> {
        gltf::write(self, generator, scene)
    }

    /// Establishes the invariants of the fields for a newly read model.
    pub(crate) fn finish(mut self) -> Result<Self, MeshError> {
        if self.materials.is_empty() {
            self.materials.push(Material::default());
        }
        repair::repair(&mut self)?;
        tangents::complete(&mut self);
        self.warn_of_transparent_materials();
        Ok(self)
    }

    /// Names the fully transparent materials of a mesh that is visible otherwise.
    fn warn_of_transparent_materials(&mut self) {
        let mut is_used = vec![false; self.materials.len()];
        self.triangle_materials.iter().for_each(|&index| is_used[index as usize] = true);
        let used = self.materials.iter().zip(is_used).filter(|&(_, is_used)| is_used).map(|(material, _)| material);
        let (transparent, visible): (Vec<_>, Vec<_>) = used.partition(|material| material.is_transparent());
        if !transparent.is_empty() && !visible.is_empty() {
            let materials = transparent.into_iter().map(|material| material.name.clone()).collect();
            self.warnings.push(MeshWarning::TransparentMaterials { materials });
        }
    }
}

/// Reads a file that a mesh refers to.
///
/// A name in another case is found, too: systems that ignore case let programs write it so.
pub(crate) fn read_file(path: &Path) -> std::io::Result<Vec<u8>> {
    let other_case = (!path.exists()).then(|| in_other_case(path)).flatten();
    read_regular_file(other_case.as_deref().unwrap_or(path), MAX_FILE_BYTES)
}

/// Returns the file of the same folder whose name differs in case only; of several, the first by name.
fn in_other_case(path: &Path) -> Option<PathBuf> {
    let name = path.file_name()?.to_str()?;
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let entries = std::fs::read_dir(folder).ok()?.flatten().map(|entry| entry.path());
    let is_alike = |path: &PathBuf| {
        path.file_name()
            .and_then(|other| other.to_str())
            .is_some_and(|other| other.to_lowercase() == name.to_lowercase())
    };
    entries.filter(is_alike).min()
}

/// Converts the name of a neighbouring file to a path, with Windows separators replaced.
pub(crate) fn local_path(name: &str) -> PathBuf {
    PathBuf::from(name.replace('\\', "/"))
}
