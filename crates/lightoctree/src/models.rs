use std::path::Path;

use lo_insert::{Layout, LayoutObject};
use lo_mesh::{LoadOptions, MeshWarning, Model, PreparedModel};

use crate::ModelError;
use crate::builtin::builtin_mesh;

/// The meshes and materials of a layout's objects, ready to be inserted.
///
/// Objects with the same mesh and material share one model.
#[derive(Debug)]
pub struct Models {
    models: Vec<PreparedModel>,
    /// Index of each object's model.
    model_indices: Vec<usize>,
}

impl Models {
    /// Loads the meshes and materials of a layout.
    ///
    /// File names are relative to `folder`. Names with [`BUILTIN_PREFIX`](crate::BUILTIN_PREFIX) refer to built-in
    /// models.
    ///
    /// # Errors
    /// - [`ModelError::Mesh`] or [`ModelError::Material`] if a file cannot be read or is invalid.
    /// - [`ModelError::Builtin`] if no built-in model has the name.
    pub fn load(layout: &Layout, folder: &Path) -> Result<Self, ModelError> {
        Self::load_by(layout, folder, |object| match object.mesh.to_str().map_or(Ok(None), builtin_mesh)? {
            Some(model) => Ok(model),
            None => Ok(Model::load(folder.join(&object.mesh), &LoadOptions::default())?),
        })
    }

    /// Loads the meshes by `mesh`, and the layout's materials from `folder`.
    pub(crate) fn load_by(
        layout: &Layout,
        folder: &Path,
        mesh: impl Fn(&LayoutObject) -> Result<Model, ModelError>,
    ) -> Result<Self, ModelError> {
        let objects = layout.objects();
        let (mut models, mut model_indices): (Vec<PreparedModel>, Vec<usize>) = (Vec::new(), Vec::new());
        for (i, object) in objects.iter().enumerate() {
            let is_same = |other: &LayoutObject| other.mesh == object.mesh && other.material == object.material;
            let known = objects[..i].iter().position(is_same).map(|other| model_indices[other]);
            model_indices.push(match known {
                Some(known) => known,
                None => {
                    let mut model = mesh(object)?;
                    apply_material(&mut model, object, folder)?;
                    models.push(PreparedModel::new(model));
                    models.len() - 1
                }
            });
        }
        Ok(Self { models, model_indices })
    }

    /// Returns the warnings of the mesh readers.
    pub fn warnings(&self) -> impl Iterator<Item = &MeshWarning> {
        self.models.iter().flat_map(|model| &model.model().warnings)
    }

    /// Returns each object's model, in the order of the layout's objects.
    pub fn per_object(&self) -> Vec<&PreparedModel> {
        self.model_indices.iter().map(|&model| &self.models[model]).collect()
    }
}

fn apply_material(model: &mut Model, object: &LayoutObject, folder: &Path) -> Result<(), ModelError> {
    let Some(material) = &object.material else { return Ok(()) };
    model
        .override_material(material, folder)
        .map_err(|source| ModelError::Material { object: object.name().to_owned(), source })
}
