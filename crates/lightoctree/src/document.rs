use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use lo_estimate::{
    FittedLight, LightReport, LightingError, apply_light, for_viewpoint, indirect_only, plausible_light,
};
use lo_geometry::Vec3;
use lo_insert::{Layout, PathSource};
use lo_lights::{LightsError, ListedLight};
use lo_mesh::{LoadOptions, Model};
use lo_scene::{
    EmitterEdit, Estimate, InferredLight, KnownLength, KnownLengthError, LightChange, LightEdits, LightMode,
    LightTuning, LitScene, ObjectDisplay, SceneError, SceneFile, SceneObjects,
};

use crate::builtin::builtin_mesh;
use crate::builtin_names::BUILTIN_PREFIX;
use crate::{ModelError, Models};

/// An estimate with the user's light edits and inserted objects, as stored in a `.scene` file.
///
/// [`Document::lit`] returns the [`LitScene`] that renders.
///
/// ```no_run
/// use lightoctree::{Document, LightPurpose, SceneRenderer, geometry::Vec3};
///
/// let document = Document::read("room.scene")?;
/// let lit = document.lit(LightPurpose::Panorama)?;
/// let panorama = SceneRenderer::new(&lit).panorama(Vec3::NEG_Z, 512, 256);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Document {
    /// The estimate, unaffected by edits.
    pub estimate: Arc<Estimate>,
    /// The user's edits of lights and choice of inferred light.
    pub light_edits: LightEdits,
    /// The objects inserted into the photo. Their meshes are in [`Document::meshes`] or built in.
    pub layout: Option<Layout>,
    /// Contents of the objects' mesh files by name.
    ///
    /// Files that a mesh refers to are named after it: `car.obj/car.mtl` is the `car.mtl` of `car.obj`.
    pub meshes: BTreeMap<String, Arc<[u8]>>,
    /// Presentation of the objects: gloss of the floor, frame rate, time.
    pub shown: ObjectDisplay,
}

/// The purpose for which a document is lit. It determines the default of inferred light.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum LightPurpose {
    /// Panoramas of the room. Default: expected light.
    Panorama,
    /// Inserted objects. Default: plausible light.
    Objects {
        /// Centre of the objects in metres, for which directional radiance is evaluated.
        at_m: Vec3,
    },
    /// Export to other programs. Default: plausible light.
    Export,
    /// Relighting with lights of another program: reflected light without emitters. Edits are ignored.
    IndirectOnly,
}

/// An error in reading or writing a document.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum DocumentError {
    /// The scene file cannot be read or written.
    #[error(transparent)]
    Scene(#[from] SceneError),
    /// The file is damaged, or is not a scene file.
    #[error("{}: {source}", path.display())]
    Damaged {
        /// The file.
        path: PathBuf,
        /// The problem.
        source: Box<DocumentError>,
    },
    /// The scene's objects are damaged or incomplete.
    #[error(transparent)]
    Objects(#[from] ModelError),
}

/// Creates a document without edits and objects.
impl From<Estimate> for Document {
    fn from(estimate: Estimate) -> Self {
        Self::new(estimate)
    }
}

impl Document {
    /// Creates a document without edits and objects.
    pub fn new(estimate: impl Into<Arc<Estimate>>) -> Self {
        Self {
            estimate: estimate.into(),
            light_edits: LightEdits::default(),
            layout: None,
            meshes: BTreeMap::new(),
            shown: ObjectDisplay::default(),
        }
    }

    /// Reads a scene file.
    ///
    /// # Errors
    /// - [`DocumentError::Scene`] if the file cannot be read.
    /// - [`DocumentError::Damaged`] if it is damaged, is not a scene file, or its layout is invalid or refers to files
    ///   outside the scene file.
    pub fn read(path: impl AsRef<Path>) -> Result<Self, DocumentError> {
        let path = path.as_ref();
        let named = |error| match error {
            DocumentError::Scene(SceneError::Read { .. }) => error,
            error => DocumentError::Damaged { path: path.to_owned(), source: Box::new(error) },
        };
        SceneFile::read(path).map_err(DocumentError::from).and_then(Self::from_file).map_err(named)
    }

    /// Reads a scene from the bytes of a scene file.
    ///
    /// # Errors
    /// - [`DocumentError::Scene`] if they are damaged or not a scene file.
    /// - [`DocumentError::Objects`] if the layout is invalid or refers to files outside the scene file.
    pub fn from_bytes(bytes: &[u8]) -> Result<Self, DocumentError> {
        Self::from_file(SceneFile::from_bytes(bytes)?)
    }

    fn from_file(SceneFile { estimate, light_edits, objects }: SceneFile) -> Result<Self, DocumentError> {
        let SceneObjects { layout, files, shown } = objects;
        let layout = if layout.is_empty() {
            None
        } else {
            let layout = Layout::from_json(&layout).map_err(ModelError::from)?;
            check_self_contained(&layout, &files)?;
            Some(layout)
        };
        Ok(Self { estimate, light_edits, layout, meshes: files, shown })
    }

    /// Writes a scene file atomically. `generator` is the name of the writing program, stored in the file.
    ///
    /// # Errors
    /// If the file cannot be written, or the objects could not be read again.
    pub fn write(&self, path: impl AsRef<Path>, generator: &str) -> Result<(), DocumentError> {
        Ok(self.to_file()?.write(path.as_ref(), generator)?)
    }

    /// Returns the bytes of the scene file. Equal documents have equal bytes.
    ///
    /// # Errors
    /// If the objects could not be read again.
    pub fn to_bytes(&self, generator: &str) -> Result<Vec<u8>, DocumentError> {
        Ok(self.to_file()?.to_bytes(generator)?)
    }

    fn to_file(&self) -> Result<SceneFile, DocumentError> {
        let layout =
            self.layout.as_ref().map(Layout::to_json).transpose().map_err(ModelError::from)?.unwrap_or_default();
        let objects = SceneObjects { layout, files: self.meshes.clone(), shown: self.shown };
        Ok(SceneFile { estimate: self.estimate.clone(), light_edits: self.light_edits.clone(), objects })
    }

    /// Returns the document with its room scaled about the camera, so that a length in it is the known one. The photo
    /// stays the same; objects keep their sizes and their places in the photo, lights shine as before.
    ///
    /// # Errors
    /// If no scale follows from the length.
    pub fn with_known_length(&self, known: &KnownLength) -> Result<Self, KnownLengthError> {
        self.scaled(known.factor(&self.estimate)?)
    }

    /// Returns the document with its room scaled about the camera by a factor.
    ///
    /// # Errors
    /// If the scaled depth is not that of a room.
    pub fn scaled(&self, factor: f32) -> Result<Self, KnownLengthError> {
        if factor == 1.0 {
            return Ok(self.clone());
        }
        // Positions beyond their range keep the objects where they were.
        let scaled = |layout: &Layout| layout.in_scaled_room(factor.into()).unwrap_or_else(|_| layout.clone());
        Ok(Self {
            estimate: self.estimate.scaled(factor)?.into(),
            light_edits: self.light_edits.in_scaled_room(factor),
            layout: self.layout.as_ref().map(scaled),
            meshes: self.meshes.clone(),
            shown: self.shown,
        })
    }

    /// Returns the document's choice of inferred light, or the purpose's default if there is none.
    pub fn inferred_light(&self, purpose: LightPurpose) -> InferredLight {
        self.light_edits
            .inferred
            .unwrap_or_else(|| InferredLight { light: purpose.default_light(), tuning: LightTuning::default() })
    }

    /// Lights the estimate for a purpose, with all edits.
    ///
    /// # Errors
    /// - [`LightingError::Edit`] if an edit refers to an emitter that does not exist.
    /// - [`LightingError::White`] or [`LightingError::WhiteWithoutColour`] if the white pixel cannot be used.
    pub fn lit(&self, purpose: LightPurpose) -> Result<LitScene, LightingError> {
        Ok(self.lit_with_report(purpose)?.0)
    }

    /// Like [`Document::lit`], and reports how inferred light was changed.
    ///
    /// # Errors
    /// The errors of [`Document::lit`].
    pub fn lit_with_report(&self, purpose: LightPurpose) -> Result<(LitScene, LightReport), LightingError> {
        let estimate = match purpose {
            LightPurpose::IndirectOnly => return Ok((indirect_only(&self.estimate), LightReport::default())),
            LightPurpose::Objects { at_m } => for_viewpoint(&self.estimate, at_m),
            LightPurpose::Panorama | LightPurpose::Export => self.estimate.clone(),
        };
        let inferred = self.inferred_light(purpose);
        if !self.light_edits.has_lights() {
            return apply_light(&estimate, &inferred);
        }
        let fitted = FittedLight::new(estimate);
        let applied = fitted.apply(&inferred)?;
        Ok((fitted.lit(&applied, &self.light_edits)?, applied.report().clone()))
    }

    /// Lists the emitters of plausible light without tuning, with the user's edits, and the lights that the user added.
    ///
    /// The emitters' names in this list are valid for every choice of light and tuning.
    pub fn lights(&self) -> Vec<ListedLight> {
        lo_lights::list(&plausible_light(&self.estimate).0, &self.light_edits)
    }

    /// Returns the light of this name.
    ///
    /// # Errors
    /// [`LightsError::Unknown`] if there is none.
    pub fn light(&self, id: &str) -> Result<ListedLight, LightsError> {
        let mut lights = self.lights();
        match lights.iter().position(|light| light.id == id) {
            Some(index) => Ok(lights.swap_remove(index)),
            None => Err(LightsError::Unknown {
                id: id.to_owned(),
                known: lights.into_iter().map(|light| light.id).collect(),
            }),
        }
    }

    /// Undoes the edits of a light, or with `None` all edits, the choice of light and the added lights.
    ///
    /// # Errors
    /// [`LightsError::Unknown`] if there is neither the light nor an edit of it.
    pub fn reset_lights(&mut self, id: Option<&str>) -> Result<(), LightsError> {
        let Some(id) = id else {
            self.light_edits = LightEdits::default();
            return Ok(());
        };
        // A light that no longer exists can still be reset.
        if !self.light_edits.emitters.iter().any(|edit| edit.id == id) {
            self.light(id)?;
        }
        let _ = self.light_edits.change(id, Vec3::ZERO, LightChange::NONE);
        Ok(())
    }

    /// Returns the edits of lights that the estimate does not have; [`Document::lit`] fails until they are removed.
    pub fn lost_light_edits(&self) -> Vec<EmitterEdit> {
        if self.light_edits.emitters.is_empty() {
            return Vec::new();
        }
        lo_lights::lost_edits(&self.light_edits, &lo_lights::emitters(&plausible_light(&self.estimate).0))
    }

    /// Loads a mesh of [`Document::meshes`], or a built-in model if the name has
    /// [`BUILTIN_PREFIX`](crate::BUILTIN_PREFIX).
    ///
    /// # Errors
    /// - [`ModelError::MissingMesh`] or [`ModelError::Builtin`] if there is no such mesh.
    /// - [`ModelError::Mesh`] if the mesh is invalid.
    pub fn mesh(&self, name: &str) -> Result<Model, ModelError> {
        if let Some(model) = builtin_mesh(name)? {
            return Ok(model);
        }
        let bytes = self.meshes.get(name).ok_or_else(|| ModelError::MissingMesh { name: name.to_owned() })?;
        let resolve = |part: &str| {
            let part = part.rsplit(['/', '\\']).next().unwrap_or_default();
            let held = self.meshes.get(&format!("{name}/{part}"));
            held.map(|bytes| bytes.to_vec()).ok_or_else(|| std::io::Error::other("it is not in the scene file"))
        };
        Ok(Model::from_bytes(name, bytes, &resolve, &LoadOptions::default())?)
    }

    /// Loads the models of a layout from [`Document::meshes`], without access to the file system.
    ///
    /// # Errors
    /// The errors of [`Document::mesh`], and [`ModelError::Material`] if a material is invalid.
    pub fn models(&self, layout: &Layout) -> Result<Models, ModelError> {
        Models::load_by(layout, Path::new(""), |object| Ok((self.mesh(&object.mesh.to_string_lossy())?, None)))
    }
}

impl LightPurpose {
    /// Returns the inferred light for this purpose in a document without a choice of light.
    pub fn default_light(self) -> LightMode {
        match self {
            Self::Panorama | Self::IndirectOnly => LightMode::Expected,
            Self::Objects { .. } | Self::Export => LightMode::Plausible,
        }
    }
}

/// Checks that a layout refers only to `meshes` and built-in models.
fn check_self_contained(layout: &Layout, meshes: &BTreeMap<String, Arc<[u8]>>) -> Result<(), ModelError> {
    for object in layout.objects() {
        let external =
            |file: &str| ModelError::ExternalFile { object: object.name().to_owned(), file: file.to_owned() };
        let mesh = object.mesh.to_string_lossy();
        if !mesh.starts_with(BUILTIN_PREFIX) && !meshes.contains_key(&*mesh) {
            return Err(external(&mesh));
        }
        if let Some(PathSource::File(file)) = &object.path {
            return Err(external(&file.to_string_lossy()));
        }
        if let Some(file) = object.material.as_ref().and_then(|material| material.files().next()) {
            return Err(external(file));
        }
    }
    Ok(())
}
