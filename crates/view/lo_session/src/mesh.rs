use std::collections::BTreeMap;
use std::fmt;
use std::path::Path;
use std::sync::{Arc, Mutex, PoisonError};

use lightoctree::geometry::Vec3;
use lightoctree::insert::Base;
use lightoctree::mesh::{MaterialSpec, Model, PreparedModel};
use lightoctree::{BUILTIN_PREFIX, Document, builtin_model};
use serde::{Deserialize, Serialize};

use crate::SessionError;

/// Materials of one mesh that are held ready.
const READY: usize = 8;

/// Files by name.
pub type Files = BTreeMap<String, Arc<[u8]>>;

/// A mesh that objects of a session are made of.
pub struct Mesh {
    name: String,
    /// Its file and, as `mesh/part`, those that it names, as they came; none for what the library carries.
    files: Files,
    plain: Arc<PreparedModel>,
    base: Base,
    /// The same of other materials, the last used one last.
    ready: Mutex<Vec<(ObjectMaterial, Arc<PreparedModel>)>>,
}

/// A material for a whole object: a preset, changed or not. It names no files: who edits it need not be who may read them.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct ObjectMaterial {
    /// One of [`Material::preset_names`](lightoctree::mesh::Material::preset_names).
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
    /// The same for the command line and layouts.
    pub fn spec(&self) -> MaterialSpec {
        MaterialSpec {
            preset: self.preset.clone(),
            base_color: self.base_color.map(lightoctree::mesh::Color::Rgb),
            metallic: self.metallic,
            roughness: self.roughness,
            ..MaterialSpec::default()
        }
    }

    /// What layouts call it; `None` where they say more of it than a session knows.
    pub(crate) fn of_spec(spec: &MaterialSpec) -> Option<Self> {
        let base_color = match &spec.base_color {
            None => None,
            Some(lightoctree::mesh::Color::Rgb(rgb)) => Some(*rgb),
            Some(_) => return None,
        };
        let known =
            Self { preset: spec.preset.clone(), base_color, metallic: spec.metallic, roughness: spec.roughness };
        (known.spec() == *spec).then_some(known)
    }

    /// # Errors
    /// Presets that there are not, numbers out of range.
    pub fn check(&self) -> Result<(), SessionError> {
        MaterialSpec::parse(&self.spec().to_text())?;
        Ok(())
    }
}

impl Mesh {
    /// A model under the name that the command line knows it by.
    pub fn new(name: String, model: Model) -> Self {
        let plain = Arc::new(PreparedModel::new(model));
        Self { name, files: Files::new(), base: Base::new(&plain), plain, ready: Mutex::default() }
    }

    /// The same with its files, which a scene that is saved holds.
    pub fn with_files(self, files: Files) -> Self {
        Self { files, ..self }
    }

    /// A mesh of a document, or one that the library carries.
    ///
    /// # Errors
    /// A mesh that is in neither, or that cannot be read.
    pub fn of_document(document: &Document, name: &str) -> Result<Self, SessionError> {
        let own = |file: &&String| file.as_str() == name || file.strip_prefix(name).is_some_and(|r| r.starts_with('/'));
        let files = document.meshes.iter().filter(|(file, _)| own(file));
        let files = files.map(|(file, bytes)| (file.clone(), bytes.clone())).collect();
        Ok(Self::new(name.to_owned(), document.mesh(name)?).with_files(files))
    }

    /// Its file and those that it names, under the names that a scene holds them by.
    pub fn files(&self) -> &Files {
        &self.files
    }

    /// One that the library carries, as `builtin:NAME`.
    ///
    /// # Errors
    /// Other names.
    pub fn builtin(name: &str) -> Result<Self, SessionError> {
        let unknown = || SessionError::NoMesh(name.to_owned());
        let model = name.strip_prefix(BUILTIN_PREFIX).and_then(builtin_model).ok_or_else(unknown)??;
        Ok(Self::new(name.to_owned(), model))
    }

    /// What `--mesh` is followed by.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// As it came.
    pub fn plain(&self) -> &Arc<PreparedModel> {
        &self.plain
    }

    /// What it touches a surface with.
    pub fn base(&self) -> &Base {
        &self.base
    }

    /// Extent along its axes, in its own units.
    pub fn size(&self) -> Vec3 {
        self.plain.bounds().size()
    }

    /// With a material, made ready once.
    ///
    /// # Errors
    /// Those of [`ObjectMaterial::check`].
    pub fn prepared(&self, material: Option<&ObjectMaterial>) -> Result<Arc<PreparedModel>, SessionError> {
        let Some(material) = material else { return Ok(self.plain.clone()) };
        let mut ready = self.ready.lock().unwrap_or_else(PoisonError::into_inner);
        let found = ready.iter().position(|(other, _)| other == material);
        let entry = match found {
            Some(index) => ready.remove(index),
            None => {
                let mut model = self.plain.model().clone();
                model.override_material(&material.spec(), Path::new(""))?;
                (material.clone(), Arc::new(PreparedModel::new(model)))
            }
        };
        let prepared = entry.1.clone();
        if ready.len() >= READY {
            ready.remove(0);
        }
        ready.push(entry);
        Ok(prepared)
    }
}

impl fmt::Debug for Mesh {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Mesh").field("name", &self.name).finish_non_exhaustive()
    }
}
