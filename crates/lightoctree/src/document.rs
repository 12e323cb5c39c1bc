use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;

use lo_estimate::{FittedLight, LightReport, LightingError, indirect_only, lit_by, plausible, seen_from};
use lo_geometry::Vec3;
use lo_insert::{Layout, PathSource};
use lo_lights::ListedLight;
use lo_mesh::{LoadOptions, Model};
use lo_scene::{
    Estimate, GuessedLight, LightEdits, LightMode, LightTuning, LitScene, ObjectDisplay, SceneError, SceneFile,
    SceneObjects,
};

use crate::builtin::{BUILTIN_PREFIX, builtin_mesh};
use crate::{ModelError, Models};

/// An estimate with the user's edits of its light and the objects in its photo: what a `.scene` file holds.
///
/// A document saves; its [`LitScene`] renders.
///
/// ```no_run
/// use lightoctree::{Document, LightPurpose, SceneRenderer, geometry::Vec3};
///
/// let document = Document::read("room.scene".as_ref())?;
/// let lit = document.lit(LightPurpose::Panorama)?;
/// let panorama = SceneRenderer::new(&lit).panorama(Vec3::NEG_Z, 512, 256);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Document {
    /// The estimate, which edits leave as it is.
    pub estimate: Arc<Estimate>,
    /// The user's changes of its light.
    pub light_edits: LightEdits,
    /// The objects in its photo. They name only meshes of [`Document::meshes`], and such as the library carries.
    pub layout: Option<Layout>,
    /// Files of the objects' meshes by name; `car.obj/car.mtl` is the file `car.mtl` that `car.obj` refers to.
    pub meshes: BTreeMap<String, Arc<[u8]>>,
    /// How the objects are shown.
    pub shown: ObjectDisplay,
}

/// What light is needed for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum LightPurpose {
    /// Panoramas of the room: expected light, unless the document chooses another one.
    Panorama,
    /// Inserted objects: plausible light, unless the document chooses another one.
    Objects {
        /// The objects' middle, metres, towards which radiance goes where it differs by direction.
        at_m: Vec3,
    },
    /// Export to other programs: plausible light, unless the document chooses another one.
    Export,
    /// Relighting by the user's own lights: only what surfaces reflect. Edits do not count.
    IndirectOnly,
}

/// Why a scene file is no document.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum DocumentError {
    /// The file cannot be read, or is damaged.
    #[error(transparent)]
    Scene(#[from] SceneError),
    /// Its objects are damaged or incomplete.
    #[error(transparent)]
    Objects(#[from] ModelError),
}

impl From<Estimate> for Document {
    /// An estimate without edits and objects.
    fn from(estimate: Estimate) -> Self {
        Self::new(estimate)
    }
}

impl Document {
    /// An estimate without edits and objects.
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
    /// Files that cannot be read or are damaged, and objects that refer to files outside of it.
    pub fn read(path: &Path) -> Result<Self, DocumentError> {
        Self::of_file(SceneFile::read(path)?)
    }

    /// Reads the bytes of a scene file.
    ///
    /// # Errors
    /// Those of [`Document::read`].
    pub fn from_bytes(bytes: &[u8]) -> Result<Self, DocumentError> {
        Self::of_file(SceneFile::from_bytes(bytes)?)
    }

    fn of_file(SceneFile { estimate, light_edits, objects }: SceneFile) -> Result<Self, DocumentError> {
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

    /// Writes the scene file; it appears whole or not at all. `generator` names the writing program in it.
    ///
    /// # Errors
    /// Those of the file system, and objects that would not be read again.
    pub fn write(&self, path: &Path, generator: &str) -> Result<(), DocumentError> {
        Ok(self.to_file()?.write(path, generator)?)
    }

    /// The bytes of the scene file. The same document gives the same bytes.
    ///
    /// # Errors
    /// Objects that would not be read again.
    pub fn to_bytes(&self, generator: &str) -> Result<Vec<u8>, DocumentError> {
        Ok(self.to_file()?.to_bytes(generator)?)
    }

    fn to_file(&self) -> Result<SceneFile, DocumentError> {
        let layout =
            self.layout.as_ref().map(Layout::to_json).transpose().map_err(ModelError::from)?.unwrap_or_default();
        let objects = SceneObjects { layout, files: self.meshes.clone(), shown: self.shown };
        Ok(SceneFile { estimate: self.estimate.clone(), light_edits: self.light_edits.clone(), objects })
    }

    /// The choice of light for a purpose: the document's own, else the purpose's default.
    pub fn guessed_light(&self, purpose: LightPurpose) -> GuessedLight {
        self.light_edits
            .guessed
            .unwrap_or_else(|| GuessedLight { light: purpose.default_light(), tuning: LightTuning::default() })
    }

    /// The estimate in the light for a purpose, with all edits.
    ///
    /// # Errors
    /// Edits of emitters that do not exist, and a white pixel without a colour.
    pub fn lit(&self, purpose: LightPurpose) -> Result<LitScene, LightingError> {
        Ok(self.lit_with_report(purpose)?.0)
    }

    /// [`Document::lit`], and how inferred light was changed.
    ///
    /// # Errors
    /// Those of [`Document::lit`].
    pub fn lit_with_report(&self, purpose: LightPurpose) -> Result<(LitScene, LightReport), LightingError> {
        let estimate = match purpose {
            LightPurpose::IndirectOnly => return Ok((indirect_only(&self.estimate), LightReport::default())),
            LightPurpose::Objects { at_m } => seen_from(&self.estimate, at_m),
            LightPurpose::Panorama | LightPurpose::Export => self.estimate.clone(),
        };
        let guessed = self.guessed_light(purpose);
        if !self.light_edits.has_lights() {
            return lit_by(&estimate, &guessed);
        }
        let fitted = FittedLight::new(estimate);
        let laid = fitted.laid(&guessed)?;
        Ok((fitted.lit(&laid, &self.light_edits)?, laid.report().clone()))
    }

    /// The lights as bright as objects are lit by them in plausible light as estimated, and those that the user added.
    ///
    /// Emitters have the names of this list whichever light is chosen, and however it is tuned.
    pub fn lights(&self) -> Vec<ListedLight> {
        lo_lights::list(&plausible(&self.estimate).0, &self.light_edits)
    }

    /// A mesh of the objects, or one that the library carries.
    ///
    /// # Errors
    /// A mesh that is in neither, or that cannot be read.
    pub fn mesh(&self, name: &str) -> Result<Model, ModelError> {
        if let Some(model) = builtin_mesh(name)? {
            return Ok(model);
        }
        let bytes = self.meshes.get(name).ok_or_else(|| ModelError::NotHeld { name: name.to_owned() })?;
        let resolve = |part: &str| {
            let part = part.rsplit(['/', '\\']).next().unwrap_or_default();
            let held = self.meshes.get(&format!("{name}/{part}"));
            held.map(|bytes| bytes.to_vec()).ok_or_else(|| std::io::Error::other("the scene does not hold it"))
        };
        Ok(Model::from_bytes(name, bytes, &resolve, &LoadOptions::default())?)
    }

    /// The models of a layout whose meshes are the document's own; no file is read.
    ///
    /// # Errors
    /// Those of [`Document::mesh`], and materials that cannot be used.
    pub fn models(&self, layout: &Layout) -> Result<Models, ModelError> {
        Models::by(layout, Path::new(""), |object| self.mesh(&object.mesh.to_string_lossy()))
    }
}

impl LightPurpose {
    /// The light that serves this purpose where nobody chose one.
    pub fn default_light(self) -> LightMode {
        match self {
            Self::Panorama | Self::IndirectOnly => LightMode::Expected,
            Self::Objects { .. } | Self::Export => LightMode::Plausible,
        }
    }
}

/// Whether a layout refers to nothing outside of `meshes`.
fn check_self_contained(layout: &Layout, meshes: &BTreeMap<String, Arc<[u8]>>) -> Result<(), ModelError> {
    for object in layout.objects() {
        let outside = |what: &str| ModelError::Outside { object: object.name().to_owned(), what: what.to_owned() };
        let mesh = object.mesh.to_string_lossy();
        if !mesh.starts_with(BUILTIN_PREFIX) && !meshes.contains_key(&*mesh) {
            return Err(outside(&mesh));
        }
        if let Some(PathSource::File(file)) = &object.path {
            return Err(outside(&file.to_string_lossy()));
        }
        if let Some(file) = object.material.as_ref().and_then(|material| material.files().next()) {
            return Err(outside(file));
        }
    }
    Ok(())
}
