//! From a photo to its results.

use std::fmt;
use std::ops::ControlFlow;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;
#[cfg(feature = "depth-models")]
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

use lightoctree::events::EstimateWarning;
use lightoctree::{DepthSource, Document, EstimateOptions, Estimator, Event, LightPurpose};
use lo_geometry::Vec3;
use lo_imaging as imaging;

use super::args::Args;
use super::photo_list::ListedPhoto;
use super::record::{Light, Record};
use crate::args::Global;
use crate::commands::environment::{self, PanoramaRenderer};
use crate::commands::estimate;
use crate::commands::level::OutputFrame;
use crate::usage::Usage;
use crate::warning_text::warning_text;
use crate::{interrupt, output, report};

/// Stack of a thread that estimates, as large as that of a program's first thread.
const STACK_BYTES: usize = 8 << 20;

/// Why a photo has no record.
pub enum Failure {
    /// The run was stopped.
    Stopped,
    /// Nothing can be estimated or written.
    Job(anyhow::Error),
}

/// A result that cannot be written. Those of other photos cannot be either.
#[derive(Debug)]
struct WriteError(String);

impl fmt::Display for WriteError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

impl std::error::Error for WriteError {}

/// Estimates photos with the options of the command.
#[derive(Clone, Copy)]
pub struct Worker<'a> {
    pub global: &'a Global,
    pub args: &'a Args,
    pub estimator: &'a Estimator,
}

impl Worker<'_> {
    /// Estimates photos that `take` returns, on one thread, and passes their records to `give`.
    ///
    /// It ends when there are no more photos, when `stop` is set, or when `give` returns false.
    ///
    /// # Errors
    /// A depth model that cannot be read, and a thread that cannot be started.
    pub fn run<'p>(
        self,
        take: impl Fn() -> Option<&'p ListedPhoto> + Sync,
        stop: &AtomicBool,
        mut give: impl FnMut(Result<Record, Failure>) -> bool + Send,
    ) -> anyhow::Result<()> {
        // A pool of its own: a photo in the common one would begin further photos while it waits for others.
        let pool = rayon::ThreadPoolBuilder::new().num_threads(1).stack_size(STACK_BYTES).build()?;
        #[cfg(feature = "depth-models")]
        let model = match self.args.depth_model.path() {
            // One for each thread: a model runs one photo at a time.
            Some(path) => Some(Arc::new(self.args.depth_model.model(path)?)),
            None => None,
        };
        let is_stopping = || stop.load(Ordering::Relaxed) || interrupt::requested();
        pool.install(|| {
            while !is_stopping() {
                let Some(photo) = take() else { break };
                let begun = Instant::now();
                #[cfg(feature = "depth-models")]
                let depth = model.clone().map_or(DepthSource::Network, DepthSource::Model);
                #[cfg(not(feature = "depth-models"))]
                let depth = DepthSource::Network;
                let result = catch_unwind(AssertUnwindSafe(|| self.estimate(photo, depth, stop)))
                    .unwrap_or_else(|_| Err(anyhow::anyhow!("internal error; the standard error has its message")));
                let result = match result {
                    Ok(record) => Ok(Record { seconds: Some(begun.elapsed().as_secs_f64()), ..record }),
                    Err(_) if is_stopping() => Err(Failure::Stopped),
                    Err(error) if error.is::<Usage>() || error.is::<WriteError>() => Err(Failure::Job(error)),
                    Err(error) => Ok(Record::failed(photo, report::error_message(&error))),
                };
                if !give(result) {
                    break;
                }
            }
        });
        Ok(())
    }

    /// Estimates a photo and writes its results, the scene as the last.
    fn estimate(self, photo: &ListedPhoto, depth: DepthSource, stop: &AtomicBool) -> anyhow::Result<Record> {
        let Self { global, args, estimator } = self;
        let path = &photo.path;
        let mut warnings = Vec::new();
        let mut on_event = |event: Event| {
            if let Event::Warning(warning) = event
                // True of all photos.
                && !matches!(warning.downcast_ref(), Some(EstimateWarning::PredictedDepth))
            {
                warnings.push(warning_text(&*warning, &[]));
            }
            if stop.load(Ordering::Relaxed) { ControlFlow::Break(()) } else { interrupt::control_flow() }
        };
        let file = imaging::read_photo(path)?;
        let given = args.lens.of(path, &file)?;
        let text = path.display().to_string();
        let resolved = estimate::resolve(estimator, path, file, &given, depth, &text, &mut on_event)?;
        let options = EstimateOptions {
            octree_depth: args.method.octree_depth,
            completion: args.method.completion,
            seed: global.seed,
            sources: sources(args, path),
            camera_source: resolved.camera_source,
            distorted: resolved.distorted,
            ..EstimateOptions::default()
        };
        let scene = estimator.estimate(resolved.input, &options, &mut on_event).map_err(estimate::estimate_error)?;
        let document = Document::new(scene);
        let result = args.output.join(photo.result_name("scene"));
        if let Some(folder) = result.parent() {
            let failed = |error| WriteError(format!("cannot create the folder {}: {error}", folder.display()));
            std::fs::create_dir_all(folder).map_err(failed)?;
        }
        let light = args.envmap_at.map(|at| self.write_envmap(&document, at, photo, &mut warnings)).transpose()?;
        if !args.no_scenes {
            // The signature of the command whose results these are.
            document.write(&result, &output::signature("estimate")).map_err(|error| WriteError(error.to_string()))?;
        }
        let hfov_deg = Some(document.estimate.frame.camera.hfov_deg());
        Ok(Record { hfov_deg, light, warnings, ..Record::kept(args, photo) })
    }

    /// Renders the environment map, as `envmap` does, and writes it.
    fn write_envmap(
        self,
        document: &Document,
        at: Vec3,
        photo: &ListedPhoto,
        warnings: &mut Vec<String>,
    ) -> anyhow::Result<Light> {
        let options = &self.args.panorama;
        let (scene, report) = document.lit_with_report(LightPurpose::Panorama)?;
        warnings.extend(report.fit.warning().iter().map(|warning| warning_text(warning, &[])));
        if let Some(position) = environment::unusual_position(&scene, at) {
            warnings.push(format!("({}, {}, {}) is {position}", at.x, at.y, at.z));
        }
        // Not an error of usage: other photos may have an up direction.
        let frame = OutputFrame::new(&scene, options.frame).map_err(|error| anyhow::anyhow!("{error}"))?;
        let height = environment::height(options.size)?;
        let rendered_height = frame.rendered_height(height);
        let renderer = PanoramaRenderer::new(&scene, [2 * rendered_height, rendered_height])?;
        let panorama = frame.panorama(renderer.at(at), height).radiance;
        let path = self.args.output.join(photo.result_name("exr"));
        environment::write(&path, &panorama, Some((at, &frame)), &options.file, "envmap")
            .map_err(|error| WriteError(report::error_message(&error)))?;
        let mut main_light = imaging::main_light(&panorama);
        if let Some(light) = &mut main_light {
            let orientation = options.file.orientation;
            light.direction = (orientation.program_from_world() * Vec3::from(light.direction)).to_array();
        }
        Ok(Light { sh9: imaging::Sh9::project(&panorama), main_light })
    }
}

/// Returns the names of the input files, as `estimate` stores them.
#[cfg_attr(not(feature = "depth-models"), expect(unused_variables, reason = "there are no depth models"))]
fn sources(args: &Args, photo: &Path) -> Vec<String> {
    #[cfg(feature = "depth-models")]
    let model = args.depth_model.path();
    #[cfg(not(feature = "depth-models"))]
    let model = None;
    let names = [Some(photo), model].into_iter().flatten().filter_map(Path::file_name);
    names.map(|name| name.to_string_lossy().into_owned()).collect()
}
