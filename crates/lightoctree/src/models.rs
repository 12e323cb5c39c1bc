use std::path::Path;

use lo_insert::{Layout, LayoutObject};
use lo_mesh::{LoadOptions, MeshError, MeshWarning, Model, PreparedModel};

use crate::{BUILTIN_MODELS, BUILTIN_PREFIX, builtin_model};

/// The models of a layout's objects; one that stands there several times is held once.
#[derive(Debug)]
pub struct Models {
    models: Vec<PreparedModel>,
    /// Of each object the index of its model.
    of_objects: Vec<usize>,
}

/// Why an object has no model.
#[derive(Debug, thiserror::Error)]
pub enum ModelError {
    /// The mesh cannot be used.
    #[error(transparent)]
    Mesh(#[from] MeshError),
    /// Its material cannot be used.
    #[error("material of {object}: {source}")]
    Material {
        /// The object's name.
        object: String,
        /// Why not.
        source: MeshError,
    },
    /// The library carries no such model.
    #[error("there is no {BUILTIN_PREFIX}{name}; there are {}", BUILTIN_MODELS.map(|name| format!("{BUILTIN_PREFIX}{name}")).join(", "))]
    Builtin {
        /// What was asked for.
        name: String,
    },
}

impl Models {
    /// Reads the meshes, whose names start from `folder` or with [`BUILTIN_PREFIX`], and gives them their materials.
    ///
    /// # Errors
    /// Files that cannot be read or hold no such thing; names that the library does not carry.
    pub fn load(layout: &Layout, folder: &Path) -> Result<Self, ModelError> {
        let objects = layout.objects();
        let (mut models, mut of_objects): (Vec<PreparedModel>, Vec<usize>) = (Vec::new(), Vec::new());
        for (i, object) in objects.iter().enumerate() {
            let is_same = |other: &LayoutObject| other.mesh == object.mesh && other.material == object.material;
            let known = objects[..i].iter().position(is_same).map(|other| of_objects[other]);
            of_objects.push(match known {
                Some(known) => known,
                None => {
                    models.push(PreparedModel::new(model(object, folder)?));
                    models.len() - 1
                }
            });
        }
        Ok(Self { models, of_objects })
    }

    /// What the readers of the meshes want to be known.
    pub fn warnings(&self) -> impl Iterator<Item = &MeshWarning> {
        self.models.iter().flat_map(|model| &model.model().warnings)
    }

    /// The model of each object.
    pub fn of_objects(&self) -> Vec<&PreparedModel> {
        self.of_objects.iter().map(|&model| &self.models[model]).collect()
    }
}

fn model(object: &LayoutObject, folder: &Path) -> Result<Model, ModelError> {
    let mut model = match object.mesh.to_str().and_then(|name| name.strip_prefix(BUILTIN_PREFIX)) {
        Some(name) => builtin_model(name).ok_or_else(|| ModelError::Builtin { name: name.to_owned() })??,
        None => Model::load(folder.join(&object.mesh), &LoadOptions::default())?,
    };
    if let Some(material) = &object.material {
        model
            .override_material(material, folder)
            .map_err(|source| ModelError::Material { object: object.name().to_owned(), source })?;
    }
    Ok(model)
}
