use std::path::Path;

use lo_insert::{Layout, LayoutObject};
use lo_mesh::{LoadOptions, MeshWarning, Model, PreparedModel};

use crate::ModelError;
use crate::builtin::builtin_mesh;

/// The models of a layout's objects; one that stands there several times is held once.
#[derive(Debug)]
pub struct Models {
    models: Vec<PreparedModel>,
    /// Of each object the index of its model.
    of_objects: Vec<usize>,
}

impl Models {
    /// Reads the meshes, whose names start from `folder` or with [`BUILTIN_PREFIX`], and gives them their materials.
    ///
    /// # Errors
    /// Files that cannot be read or hold no such thing; names that the library does not carry.
    pub fn load(layout: &Layout, folder: &Path) -> Result<Self, ModelError> {
        Self::by(layout, folder, |object| match object.mesh.to_str().map_or(Ok(None), builtin_mesh)? {
            Some(model) => Ok(model),
            None => Ok(Model::load(folder.join(&object.mesh), &LoadOptions::default())?),
        })
    }

    /// The models that `mesh` gives, with the materials of the layout, whose files are in `folder`.
    pub(crate) fn by(
        layout: &Layout,
        folder: &Path,
        mesh: impl Fn(&LayoutObject) -> Result<Model, ModelError>,
    ) -> Result<Self, ModelError> {
        let objects = layout.objects();
        let (mut models, mut of_objects): (Vec<PreparedModel>, Vec<usize>) = (Vec::new(), Vec::new());
        for (i, object) in objects.iter().enumerate() {
            let is_same = |other: &LayoutObject| other.mesh == object.mesh && other.material == object.material;
            let known = objects[..i].iter().position(is_same).map(|other| of_objects[other]);
            of_objects.push(match known {
                Some(known) => known,
                None => {
                    let mut model = mesh(object)?;
                    give_material(&mut model, object, folder)?;
                    models.push(PreparedModel::new(model));
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

fn give_material(model: &mut Model, object: &LayoutObject, folder: &Path) -> Result<(), ModelError> {
    let Some(material) = &object.material else { return Ok(()) };
    model
        .override_material(material, folder)
        .map_err(|source| ModelError::Material { object: object.name().to_owned(), source })
}
