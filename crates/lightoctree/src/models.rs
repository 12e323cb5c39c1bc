use std::path::Path;

use lo_insert::{InsertError, Layout, LayoutObject, PathSource};
use lo_mesh::{LoadOptions, MeshError, MeshWarning, Model, PreparedModel};
use lo_scene::{Scene, SceneObjects};

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
    /// What stands in a scene is no layout.
    #[error("the scene's objects: {0}")]
    Layout(#[from] InsertError),
    /// An object of a scene names a file beside it.
    #[error("the scene's objects: {object} needs {what}, which the scene does not hold")]
    Outside {
        /// The object's name.
        object: String,
        /// The file.
        what: String,
    },
    /// A scene does not hold a mesh.
    #[error("the scene does not hold the mesh {name}")]
    NotHeld {
        /// Which.
        name: String,
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
        Self::of(layout, |object| {
            let mut model = match object.mesh.to_str().map_or(Ok(None), builtin)? {
                Some(model) => model,
                None => Model::load(folder.join(&object.mesh), &LoadOptions::default())?,
            };
            give_material(&mut model, object, folder)?;
            Ok(model)
        })
    }

    /// The same of a scene's own objects, as [`scene_layout`] tells them; no file is read.
    ///
    /// # Errors
    /// Meshes that the scene does not hold or that cannot be read, and names that the library does not carry.
    pub fn of_scene(layout: &Layout, scene: &Scene) -> Result<Self, ModelError> {
        Self::of(layout, |object| {
            let mut model = scene_mesh(scene, &object.mesh.to_string_lossy())?;
            give_material(&mut model, object, Path::new(""))?;
            Ok(model)
        })
    }

    fn of(layout: &Layout, model: impl Fn(&LayoutObject) -> Result<Model, ModelError>) -> Result<Self, ModelError> {
        let objects = layout.objects();
        let (mut models, mut of_objects): (Vec<PreparedModel>, Vec<usize>) = (Vec::new(), Vec::new());
        for (i, object) in objects.iter().enumerate() {
            let is_same = |other: &LayoutObject| other.mesh == object.mesh && other.material == object.material;
            let known = objects[..i].iter().position(is_same).map(|other| of_objects[other]);
            of_objects.push(match known {
                Some(known) => known,
                None => {
                    models.push(PreparedModel::new(model(object)?));
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

/// What stands in a scene's photo; `None` where nothing does.
///
/// # Errors
/// Where that is no layout, or one that names files beside the scene.
pub fn scene_layout(scene: &Scene) -> Result<Option<Layout>, ModelError> {
    let SceneObjects { layout, files, .. } = &scene.objects;
    if layout.is_empty() {
        return Ok(None);
    }
    let layout = Layout::from_json(layout)?;
    for object in layout.objects() {
        let outside = |what: &str| ModelError::Outside { object: object.name().to_owned(), what: what.to_owned() };
        let mesh = object.mesh.to_string_lossy();
        if !mesh.starts_with(BUILTIN_PREFIX) && !files.contains_key(&*mesh) {
            return Err(outside(&mesh));
        }
        if let Some(PathSource::File(file)) = &object.path {
            return Err(outside(&file.to_string_lossy()));
        }
        if let Some(file) = object.material.as_ref().and_then(|material| material.files().next()) {
            return Err(outside(file));
        }
    }
    Ok(Some(layout))
}

/// A mesh of a scene's objects, or one that the library carries.
///
/// # Errors
/// Where the scene does not hold it, or it cannot be read.
pub fn scene_mesh(scene: &Scene, name: &str) -> Result<Model, ModelError> {
    if let Some(model) = builtin(name)? {
        return Ok(model);
    }
    let files = &scene.objects.files;
    let bytes = files.get(name).ok_or_else(|| ModelError::NotHeld { name: name.to_owned() })?;
    let resolve = |part: &str| {
        let part = part.rsplit(['/', '\\']).next().unwrap_or_default();
        let held = files.get(&format!("{name}/{part}"));
        held.map(|bytes| bytes.to_vec()).ok_or_else(|| std::io::Error::other("the scene does not hold it"))
    };
    Ok(Model::from_bytes(name, bytes, &resolve, &LoadOptions::default())?)
}

/// The model of a name that begins with [`BUILTIN_PREFIX`]; `None` of others.
fn builtin(name: &str) -> Result<Option<Model>, ModelError> {
    let Some(name) = name.strip_prefix(BUILTIN_PREFIX) else { return Ok(None) };
    let model = builtin_model(name).ok_or_else(|| ModelError::Builtin { name: name.to_owned() })??;
    Ok(Some(model))
}

fn give_material(model: &mut Model, object: &LayoutObject, folder: &Path) -> Result<(), ModelError> {
    let Some(material) = &object.material else { return Ok(()) };
    model
        .override_material(material, folder)
        .map_err(|source| ModelError::Material { object: object.name().to_owned(), source })
}
