use std::path::{Path, PathBuf};

use lo_insert::{Layout, LayoutObject};
use lo_mesh::{AnimatedModel, LoadOptions, MeshError, MeshWarning, Model, PreparedModel};

use crate::ModelError;
use crate::builtin::builtin_mesh;

/// The meshes and materials of a layout's objects, ready to be inserted.
///
/// Objects with the same mesh, animation and material share one model.
#[derive(Debug)]
pub struct Models {
    models: Vec<PreparedModel>,
    /// The animation of each model, if it has one.
    animations: Vec<Option<ModelAnimation>>,
    /// Index of each object's model.
    model_indices: Vec<usize>,
}

impl Models {
    /// Loads the meshes and materials of a layout; animated ones in their first pose.
    ///
    /// File names are relative to `folder`. Names with [`BUILTIN_PREFIX`](crate::BUILTIN_PREFIX) refer to built-in
    /// models.
    ///
    /// # Errors
    /// - [`ModelError::Mesh`] or [`ModelError::Material`] if a file cannot be read or is invalid.
    /// - [`ModelError::Builtin`] if no built-in model has the name.
    pub fn load(layout: &Layout, folder: &Path) -> Result<Self, ModelError> {
        Self::load_by(layout, folder, |object| {
            if let Some(model) = object.mesh.to_str().map_or(Ok(None), builtin_mesh)? {
                // No built-in model has animations.
                return match &object.animation {
                    Some(name) => Err(MeshError::NoAnimation { name: name.clone(), names: Vec::new() }.into()),
                    None => Ok((model, None)),
                };
            }
            let file = folder.join(&object.mesh);
            let Some(animation) = &object.animation else {
                return Ok((Model::load(file, &LoadOptions::default())?, None));
            };
            let animated = AnimatedModel::load(file, animation)?;
            Ok((animated.at(0.0)?, Some(animated)))
        })
    }

    /// Loads the meshes, with their animations, by `mesh`, and the layout's materials from `folder`.
    pub(crate) fn load_by(
        layout: &Layout,
        folder: &Path,
        mesh: impl Fn(&LayoutObject) -> Result<(Model, Option<AnimatedModel>), ModelError>,
    ) -> Result<Self, ModelError> {
        let objects = layout.objects();
        let (mut models, mut model_indices): (Vec<PreparedModel>, Vec<usize>) = (Vec::new(), Vec::new());
        let mut animations = Vec::new();
        for (i, object) in objects.iter().enumerate() {
            let is_same = |other: &LayoutObject| {
                (&other.mesh, &other.animation, &other.material) == (&object.mesh, &object.animation, &object.material)
            };
            let known = objects[..i].iter().position(is_same).map(|other| model_indices[other]);
            model_indices.push(match known {
                Some(known) => known,
                None => {
                    let (mut model, animated) = mesh(object)?;
                    apply_material(&mut model, object, folder)?;
                    animations.push(animated.map(|model| ModelAnimation {
                        model,
                        object: object.clone(),
                        folder: folder.to_owned(),
                    }));
                    models.push(PreparedModel::new(model));
                    models.len() - 1
                }
            });
        }
        Ok(Self { models, animations, model_indices })
    }

    /// Returns the warnings of the mesh readers.
    pub fn warnings(&self) -> impl Iterator<Item = &MeshWarning> {
        self.models.iter().flat_map(|model| &model.model().warnings)
    }

    /// Returns each object's model, in the order of the layout's objects.
    pub fn per_object(&self) -> Vec<&PreparedModel> {
        self.model_indices.iter().map(|&model| &self.models[model]).collect()
    }

    /// Returns the poses of the animated models at a time in seconds.
    ///
    /// # Errors
    /// As for [`Models::load`].
    pub fn at(&self, time_s: f32) -> Result<PosedModels<'_>, ModelError> {
        let pose = |(first, animation): (&PreparedModel, &Option<ModelAnimation>)| {
            let Some(ModelAnimation { model, object, folder }) = animation else { return Ok(None) };
            let mut posed = model.at(time_s)?;
            apply_material(&mut posed, object, folder)?;
            Ok(Some(PreparedModel::new(posed).with_base_of(first)))
        };
        let poses = self.models.iter().zip(&self.animations).map(pose).collect::<Result<_, ModelError>>()?;
        Ok(PosedModels { models: self, poses })
    }
}

/// [`Models`] at a time of their animations.
#[derive(Debug)]
pub struct PosedModels<'a> {
    models: &'a Models,
    /// Pose of each animated model.
    poses: Vec<Option<PreparedModel>>,
}

impl PosedModels<'_> {
    /// Returns each object's model, in the order of the layout's objects.
    pub fn per_object(&self) -> Vec<&PreparedModel> {
        let of = |&index: &usize| self.poses[index].as_ref().unwrap_or(&self.models.models[index]);
        self.models.model_indices.iter().map(of).collect()
    }
}

/// An animation of a model.
#[derive(Debug)]
struct ModelAnimation {
    model: AnimatedModel,
    /// The object, for its material.
    object: LayoutObject,
    folder: PathBuf,
}

fn apply_material(model: &mut Model, object: &LayoutObject, folder: &Path) -> Result<(), ModelError> {
    let Some(material) = &object.material else { return Ok(()) };
    model
        .override_material(material, folder)
        .map_err(|source| ModelError::Material { object: object.name().to_owned(), source })
}
