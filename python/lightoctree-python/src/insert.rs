use std::path::PathBuf;

use lightoctree::geometry::Vec3;
use lightoctree::insert::{Composite, InsertError, Inserter, Instance, Layout, Lighting, Placement, Quality};
use lightoctree::{Document, LightPurpose, Models};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

use crate::errors::Failure;
use crate::inputs::inputs;
use crate::job::Reporter;

/// Longest path of keyframes, in bytes.
const MAX_TEXT_BYTES: u64 = 64 << 20;

/// Objects to be inserted into the photo of a document.
pub struct Insertion {
    document: Document,
    source: Source,
    quality: Quality,
    floor_gloss: f32,
}

/// Where the objects come from.
enum Source {
    /// JSON of a layout; paths in it are relative to the folder.
    Files { layout: String, folder: PathBuf },
    /// The document, which contains them with their meshes.
    Document(Layout),
}

impl Insertion {
    /// Collects what a user gives.
    pub fn new(
        py: Python<'_>,
        document: Document,
        objects: Option<&Bound<'_, PyAny>>,
        quality: Quality,
        floor_gloss: Option<f64>,
    ) -> PyResult<Self> {
        let (source, saved_gloss) = match (objects, &document.layout) {
            (Some(objects), _) => {
                let (layout, folder) = inputs(py)?.call_method1("layout", (objects,))?.extract()?;
                (Source::Files { layout, folder }, 0.0)
            }
            (None, Some(layout)) => (Source::Document(layout.clone()), document.shown.floor_gloss),
            (None, None) => {
                return Err(PyValueError::new_err("nothing to insert: the scene has no objects, give some"));
            }
        };
        let floor_gloss = floor_gloss.map_or(saved_gloss, |gloss| gloss as f32);
        Ok(Self { document, source, quality, floor_gloss })
    }

    /// Places the objects, applies the light and renders.
    pub fn run(self, reporter: &mut Reporter) -> Result<Composite, Failure> {
        let document = &self.document;
        let (layout, models) = match self.source {
            Source::Files { layout, folder } => {
                let read = |path: &std::path::Path| lo_imaging::read_regular_text(folder.join(path), MAX_TEXT_BYTES);
                let layout = Layout::from_json(&layout)?.with_paths(read)?;
                let models = Models::load(&layout, &folder)?;
                (layout, models)
            }
            Source::Document(layout) => {
                let models = document.models(&layout)?;
                (layout, models)
            }
        };
        models.warnings().for_each(|warning| reporter.warn(warning));
        let names: Vec<String> = layout.objects().iter().map(|object| object.name().to_owned()).collect();
        reporter.name_objects(names.clone());
        let named = |error| with_object_name(error, &names);
        let models = models.per_object();
        // The first frame, if objects move.
        let placements = layout.placements(&*document.estimate, &models, 1).map_err(named)?;
        let placements: Vec<Placement> = placements.iter().map(|frames| frames[0]).collect();
        let at_m = placements.iter().map(|placement| placement.position_m).sum::<Vec3>() / placements.len() as f32;
        let (lit, report) = document.lit_with_report(LightPurpose::Objects { at_m })?;
        report.fit.warning().iter().for_each(|warning| reporter.warn(warning));
        let inserter = Inserter::new(&lit, Lighting::Octree, self.quality)?.with_floor_gloss(self.floor_gloss);
        let instances: Vec<Instance<'_>> =
            models.iter().zip(&placements).map(|(model, placement)| Instance::new(model, *placement)).collect();
        inserter.render(&instances, &mut |event| reporter.handle(event)).map_err(named)
    }
}

/// Adds the name of the object to an error, if there are several objects.
fn with_object_name(error: InsertError, names: &[String]) -> Failure {
    match error {
        InsertError::Object { source, .. } if names.len() == 1 => (*source).into(),
        InsertError::Object { object, source } => NamedError { name: names[object].clone(), source: *source }.into(),
        error => error.into(),
    }
}

/// The error of one of several objects.
#[derive(Debug)]
struct NamedError {
    name: String,
    source: InsertError,
}

impl std::fmt::Display for NamedError {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}: {}", self.name, self.source)
    }
}

impl std::error::Error for NamedError {
    fn source(&self) -> Option<&(dyn std::error::Error + 'static)> {
        Some(&self.source)
    }
}

impl From<NamedError> for Failure {
    fn from(error: NamedError) -> Self {
        Self::new("InsertError", error)
    }
}
