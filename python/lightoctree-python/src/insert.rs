use std::fmt;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

use lightoctree::geometry::Vec3;
use lightoctree::insert::{InsertError, Inserter, Instance, Layout, Lighting, Placement, Quality};
use lightoctree::{Document, LightPurpose, Models};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

use crate::composite::Composite;
use crate::errors::Failure;
use crate::inputs::inputs;
use crate::job::{self, Handler, Reporter};

/// Longest path of keyframes, in bytes.
const MAX_TEXT_BYTES: u64 = 64 << 20;

/// Objects to be inserted into the photo of a document.
pub struct Insertion {
    document: Document,
    source: Source,
    quality: Quality,
    floor_gloss: Option<f32>,
    match_look: bool,
    passes: bool,
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
        match_look: bool,
        passes: bool,
    ) -> PyResult<Self> {
        if let Some(gloss) = floor_gloss.filter(|gloss| !(0.0..=1.0).contains(gloss)) {
            return Err(PyValueError::new_err(format!("floor_gloss must be from 0 to 1, not {gloss}")));
        }
        let source = match (objects, &document.layout) {
            (Some(objects), _) => {
                let (layout, folder) = inputs(py)?.call_method1("layout", (objects,))?.extract()?;
                Source::Files { layout, folder }
            }
            (None, Some(layout)) => Source::Document(layout.clone()),
            (None, None) => {
                return Err(PyValueError::new_err("nothing to insert: the scene has no objects, give some"));
            }
        };
        let floor_gloss = floor_gloss.map(|gloss| gloss as f32);
        Ok(Self { document, source, quality, floor_gloss, match_look, passes })
    }

    /// Prepares a single image.
    pub fn image(self, reporter: &mut Reporter) -> Result<Prepared, Failure> {
        self.prepared(reporter, |layout, _| match moving(layout) {
            Some(name) => Err(Failure::Argument(format!("{name} moves: use sequence with the number of frames"))),
            None => Ok(1),
        })
    }

    /// Prepares a sequence, by default with as many frames as the viewer has saved with the scene's own objects.
    pub fn sequence(self, frames: Option<usize>, reporter: &mut Reporter) -> Result<Prepared, Failure> {
        self.prepared(reporter, |layout, saved| match (moving(layout), frames.or(saved)) {
            (None, _) => Err(Failure::Argument("no object moves: use insert".to_owned())),
            (Some(_), Some(frames)) => Ok(frames),
            (Some(name), None) => Err(Failure::Argument(format!("{name} moves: give the number of frames"))),
        })
    }

    /// Loads and places the objects, and applies the light. `frames` returns the number of frames from the layout and
    /// the saved number.
    fn prepared(
        self,
        reporter: &mut Reporter,
        frames: impl FnOnce(&Layout, Option<usize>) -> Result<usize, Failure>,
    ) -> Result<Prepared, Failure> {
        let document = &self.document;
        let (layout, models, saved) = match self.source {
            Source::Files { layout, folder } => {
                let read = |path: &Path| lo_imaging::read_regular_text(folder.join(path), MAX_TEXT_BYTES);
                let layout = shown(Layout::from_json(&layout)?.with_paths(read)?)?;
                let models = Models::load(&layout, &folder)?;
                (layout, models, None)
            }
            Source::Document(layout) => {
                let layout = shown(layout)?;
                let models = document.models(&layout)?;
                (layout, models, Some(document.shown))
            }
        };
        models.warnings().for_each(|warning| reporter.warn(warning));
        let names: Vec<String> = layout.objects().iter().map(|object| object.name().to_owned()).collect();
        let span_s = layout.span_s()?;
        let saved_frames = saved.zip(span_s).map(|(shown, span_s)| shown.frames_between(span_s) as usize);
        let frames = frames(&layout, saved_frames)?;
        let placed = layout.placements(&*document.estimate, &models.per_object(), frames);
        let placements = placed.map_err(|error| with_object_name(error, &names))?;
        let at_m = placements.iter().map(|frames| frames[0].position_m).sum::<Vec3>() / placements.len() as f32;
        let (lit, report) = document.lit_with_report(LightPurpose::Objects { at_m })?;
        report.fit.warning().iter().for_each(|warning| reporter.warn(warning));
        let floor_gloss = self.floor_gloss.unwrap_or(saved.unwrap_or_default().floor_gloss);
        let inserter = Inserter::new(&lit, Lighting::Octree, self.quality)?.with_floor_gloss(floor_gloss);
        let inserter = if self.match_look { inserter.with_photo_look() } else { inserter };
        let inserter = if self.passes { inserter.with_passes() } else { inserter };
        Ok(Prepared { inserter, models, names, placements, frames })
    }
}

/// Returns the layout without hidden objects.
fn shown(layout: Layout) -> Result<Layout, Failure> {
    layout.without_hidden().ok_or_else(|| Failure::Argument("nothing to insert: all objects are hidden".to_owned()))
}

/// Returns the name of the first object that moves.
fn moving(layout: &Layout) -> Option<&str> {
    layout
        .objects()
        .iter()
        .find(|object| object.path.is_some() || object.animation.is_some())
        .map(|object| object.name())
}

/// Frames per second of animations.
const FRAMES_PER_SECOND: f32 = 24.0;

/// Objects at their placements in a lit scene.
pub struct Prepared {
    inserter: Inserter,
    models: Models,
    names: Vec<String>,
    /// Placement of each object in each frame.
    placements: Vec<Vec<Placement>>,
    frames: usize,
}

impl Prepared {
    /// Renders a frame.
    pub fn render(&self, frame: usize, reporter: &mut Reporter) -> Result<Composite, Failure> {
        reporter.name_objects(self.names.clone());
        let posed = self.models.at(frame as f32 / FRAMES_PER_SECOND)?;
        let models = posed.per_object();
        let placed = models.iter().zip(&self.placements).zip(&self.names);
        let instances: Vec<Instance<'_>> = placed
            .map(|((model, placements), name)| Instance::in_sequence(model, placements, frame).named(name))
            .collect();
        let rendered = self.inserter.render(&instances, &mut |event| reporter.handle(event));
        rendered.map(Composite::new).map_err(|error| with_object_name(error, &self.names))
    }
}

/// The images of a sequence, rendered one after the other as they are asked for.
#[pyclass(frozen, module = "lightoctree")]
pub struct Sequence {
    prepared: Arc<Prepared>,
    next: AtomicUsize,
    on_event: Option<Py<PyAny>>,
}

impl Sequence {
    /// Begins a sequence.
    pub fn new(prepared: Prepared, on_event: Option<&Bound<'_, PyAny>>) -> Self {
        Self {
            prepared: Arc::new(prepared),
            next: AtomicUsize::new(0),
            on_event: on_event.map(|on| on.clone().unbind()),
        }
    }
}

#[pymethods]
impl Sequence {
    fn __iter__(slf: Py<Self>) -> Py<Self> {
        slf
    }

    fn __next__(&self, py: Python<'_>) -> PyResult<Option<Composite>> {
        let frame = self.next.fetch_add(1, Ordering::Relaxed);
        if frame >= self.prepared.frames {
            return Ok(None);
        }
        let prepared = self.prepared.clone();
        let on_event = self.on_event.as_ref().map(|on_event| on_event.bind(py));
        job::run(py, Handler::new(on_event), move |reporter| prepared.render(frame, reporter)).map(Some)
    }

    /// Number of images that are left.
    fn __len__(&self) -> usize {
        self.prepared.frames.saturating_sub(self.next.load(Ordering::Relaxed))
    }
}

/// Adds the name of the object to an error, if there are several objects.
fn with_object_name(error: InsertError, names: &[String]) -> Failure {
    match error {
        InsertError::Object { source, .. } if names.len() == 1 => (*source).into(),
        InsertError::Object { object, source } => {
            Failure::new("InsertError", NamedError { name: names[object].clone(), source: *source })
        }
        error => error.into(),
    }
}

/// The error of one of several objects.
#[derive(Debug)]
struct NamedError {
    name: String,
    source: InsertError,
}

impl fmt::Display for NamedError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: {}", self.name, self.source)
    }
}

impl std::error::Error for NamedError {
    fn source(&self) -> Option<&(dyn std::error::Error + 'static)> {
        Some(&self.source)
    }
}
