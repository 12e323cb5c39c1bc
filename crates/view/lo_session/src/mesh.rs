use std::collections::BTreeMap;
use std::fmt;
use std::path::Path;
use std::sync::{Arc, Mutex, PoisonError};

use lightoctree::{BUILTIN_PREFIX, Document, builtin_model};
use lo_geometry::Vec3;
use lo_insert::Base;
use lo_mesh::{MaterialSpec, Model, PreparedModel};
use serde::{Deserialize, Serialize};

use crate::SessionError;

/// Maximum number of cached materials of a mesh.
const MAX_CACHED_MATERIALS: usize = 8;

/// Files by name.
pub type Files = BTreeMap<String, Arc<[u8]>>;

/// A mesh available to a session.
pub struct Mesh {
    name: String,
    /// The mesh file and, as `mesh/part`, the files that it references; empty for built-in meshes.
    files: Files,
    plain: Arc<PreparedModel>,
    base: Base,
    /// Copies with other materials, most recently used last.
    by_material: Mutex<Vec<(ObjectMaterial, Arc<PreparedModel>)>>,
}

/// A material for a whole object: a preset, optionally modified.
///
/// References no files, because whoever edits it may lack the right to read them.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "typescript", derive(ts_rs::TS), ts(optional_fields))]
#[serde(deny_unknown_fields, default)]
pub struct ObjectMaterial {
    /// One of [`Material::preset_names`](lo_mesh::Material::preset_names).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub preset: Option<String>,
    /// Linear RGB in [0, 1].
    #[serde(skip_serializing_if = "Option::is_none")]
    pub base_color: Option<[f32; 3]>,
    /// 0 dielectric … 1 metal.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub metallic: Option<f32>,
    /// Perceptual roughness in [0, 1].
    #[serde(skip_serializing_if = "Option::is_none")]
    pub roughness: Option<f32>,
}

impl ObjectMaterial {
    /// Returns the material as the command line and layouts specify it.
    pub fn spec(&self) -> MaterialSpec {
        MaterialSpec {
            preset: self.preset.clone(),
            base_color: self.base_color.map(lo_mesh::Color::Rgb),
            metallic: self.metallic,
            roughness: self.roughness,
            ..MaterialSpec::default()
        }
    }

    /// Converts the material of a layout; `None` if it has fields that a session does not support.
    pub(crate) fn from_spec(spec: &MaterialSpec) -> Option<Self> {
        let base_color = match &spec.base_color {
            None => None,
            Some(lo_mesh::Color::Rgb(rgb)) => Some(*rgb),
            Some(_) => return None,
        };
        let known =
            Self { preset: spec.preset.clone(), base_color, metallic: spec.metallic, roughness: spec.roughness };
        (known.spec() == *spec).then_some(known)
    }

    /// Validates the material.
    ///
    /// # Errors
    /// If the preset is unknown or a number is out of range.
    pub fn check(&self) -> Result<(), SessionError> {
        MaterialSpec::parse(&self.spec().to_text())?;
        Ok(())
    }
}

impl Mesh {
    /// Prepares a model. `name` identifies it on the command line.
    pub fn new(name: String, model: Model) -> Self {
        let plain = Arc::new(PreparedModel::new(model));
        Self { name, files: Files::new(), base: Base::new(&plain), plain, by_material: Mutex::default() }
    }

    /// Sets the files, which are stored in saved scenes.
    pub fn with_files(self, files: Files) -> Self {
        Self { files, ..self }
    }

    /// Loads a mesh of a document, or a built-in one.
    ///
    /// # Errors
    /// If there is no such mesh, or it cannot be read.
    pub fn from_document(document: &Document, name: &str) -> Result<Self, SessionError> {
        let own = |file: &&String| file.as_str() == name || file.strip_prefix(name).is_some_and(|r| r.starts_with('/'));
        let files = document.meshes.iter().filter(|(file, _)| own(file));
        let files = files.map(|(file, bytes)| (file.clone(), bytes.clone())).collect();
        Ok(Self::new(name.to_owned(), document.mesh(name)?).with_files(files))
    }

    /// Returns the mesh file and the files that it references, under their names in a scene file.
    pub fn files(&self) -> &Files {
        &self.files
    }

    /// Loads a built-in mesh, `builtin:NAME`.
    ///
    /// # Errors
    /// If there is no built-in mesh of that name.
    pub fn builtin(name: &str) -> Result<Self, SessionError> {
        let builtin = name.strip_prefix(BUILTIN_PREFIX).ok_or_else(|| SessionError::NoMesh(name.to_owned()))?;
        Ok(Self::new(name.to_owned(), builtin_model(builtin)?))
    }

    /// Returns whether the mesh is a built-in one.
    pub fn is_builtin(&self) -> bool {
        self.name.starts_with(BUILTIN_PREFIX)
    }

    /// Returns the value of `--mesh` on the command line.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Returns the model with its own materials.
    pub fn plain(&self) -> &Arc<PreparedModel> {
        &self.plain
    }

    /// Returns the part that touches a supporting surface.
    pub fn base(&self) -> &Base {
        &self.base
    }

    /// Returns the extent along the axes, in the mesh's units.
    pub fn size(&self) -> Vec3 {
        self.plain.bounds().size()
    }

    /// Returns the model with a material. Cached.
    ///
    /// # Errors
    /// Those of [`ObjectMaterial::check`].
    pub fn prepared(&self, material: Option<&ObjectMaterial>) -> Result<Arc<PreparedModel>, SessionError> {
        let Some(material) = material else { return Ok(self.plain.clone()) };
        let mut cached = self.by_material.lock().unwrap_or_else(PoisonError::into_inner);
        let found = cached.iter().position(|(other, _)| other == material);
        let entry = match found {
            Some(index) => cached.remove(index),
            None => {
                let mut model = self.plain.model().clone();
                model.override_material(&material.spec(), Path::new(""))?;
                (material.clone(), Arc::new(PreparedModel::new(model)))
            }
        };
        let prepared = entry.1.clone();
        if cached.len() >= MAX_CACHED_MATERIALS {
            cached.remove(0);
        }
        cached.push(entry);
        Ok(prepared)
    }
}

impl fmt::Debug for Mesh {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Mesh").field("name", &self.name).finish_non_exhaustive()
    }
}
