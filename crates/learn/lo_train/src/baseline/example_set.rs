//! The pool of a run's examples, prepared once and kept in files.

use std::path::{Path, PathBuf};
use std::time::Instant;

use lo_baselines::{BaselineExample, fingerprint};
use lo_dataset::stages::READ_SAMPLES;
use lo_dataset::{LoaderState, Split, fingerprint as dataset_fingerprint, indices_of};
use lo_events::{Cancelled, Event, OnEvent, warn};
use lo_nets::checkpoint::{Checkpoint, Precision};
use lo_nets::depth::DepthNet;
use serde_json::json;

use super::config::BaselineConfig;
use super::example::baseline_example;
use crate::augmentation::Variation;
use crate::error::TrainError;
use crate::prefetch::{Prefetcher, SkippedSample};
use crate::sources::Sources;
use crate::warning::TrainingWarning;

/// Describes the examples of a folder; written last.
const LIST: &str = "examples.json";

/// Changes whenever examples are made differently.
const VERSION: u32 = 1;

/// Consecutive unusable samples after which the run fails.
const MAX_UNUSABLE: u64 = 200;

/// Examples of a run.
pub(super) struct ExampleSet {
    pub train: Vec<BaselineExample>,
    /// Photos of held-out rooms without augmentation, each with probes at panoramas alone.
    pub validation: Vec<BaselineExample>,
    /// Hash of what the examples depend on.
    pub key: u64,
}

impl ExampleSet {
    /// Reads the examples from a subfolder of `folder` that is named by their key. Makes and writes them if there are
    /// none. The system is not part of the key: all systems share their examples.
    ///
    /// # Errors
    /// Unreadable data, files that cannot be read or written, cancellation.
    pub fn open(
        config: &BaselineConfig,
        folder: &Path,
        seed: u64,
        depth_net: &DepthNet,
        on_event: OnEvent,
    ) -> Result<Self, TrainError> {
        let sources = Sources::open(&config.data, seed)?;
        let description = json!({
            "version": VERSION,
            "data": format!("{:016x}", dataset_fingerprint(&*sources.all)),
            "depth_net": format!("{:016x}", fingerprint(depth_net)),
            "seed": seed,
            "photos": config.photos,
            "probes": config.probes,
            "validation": config.validation.photos,
            "augmentation": config.variations(),
        });
        let key = lo_random::hash(description.to_string().as_bytes());
        let folder = folder.join(format!("{key:016x}"));
        let files = ExampleFiles { folder };
        if files.are_complete() {
            return files.read(config, key);
        }
        let made = Maker { config, sources, depth_net, seed, files: &files };
        made.train(on_event)?;
        let validation = made.validation(on_event)?;
        files.finish(&json!({ "examples": description, "validation_photos": validation }))?;
        files.read(config, key)
    }
}

/// Files of examples in one folder.
struct ExampleFiles {
    folder: PathBuf,
}

impl ExampleFiles {
    fn path(&self, part: &str, index: usize) -> PathBuf {
        self.folder.join(format!("{part}-{index:06}.safetensors"))
    }

    fn are_complete(&self) -> bool {
        self.folder.join(LIST).exists()
    }

    fn write(&self, part: &str, index: usize, example: &BaselineExample) -> Result<(), TrainError> {
        Ok(example.to_checkpoint().write(self.path(part, index), Precision::Half)?)
    }

    fn finish(&self, list: &serde_json::Value) -> Result<(), TrainError> {
        let path = self.folder.join(LIST);
        let text = format!("{list:#}\n");
        lo_imaging::write_atomically(&path, |out| std::io::Write::write_all(out, text.as_bytes()))
            .map_err(TrainError::io(&path))
    }

    /// Reads all examples, so that those of a new run are as rounded as those of a resumed one.
    fn read(&self, config: &BaselineConfig, key: u64) -> Result<ExampleSet, TrainError> {
        let path = self.folder.join(LIST);
        let text = std::fs::read_to_string(&path).map_err(TrainError::io(&path))?;
        let list: serde_json::Value = serde_json::from_str(&text).unwrap_or_default();
        let validation = list["validation_photos"].as_u64().unwrap_or(0) as usize;
        let part = |name: &'static str, count: usize| -> Result<Vec<BaselineExample>, TrainError> {
            let of = |index| {
                let path = self.path(name, index);
                let file = Checkpoint::read(&path)?;
                let wrong = |error: lo_baselines::BaselineError| TrainError::NotThisRun {
                    path: path.clone(),
                    reason: error.to_string(),
                };
                BaselineExample::from_checkpoint(&file).map_err(wrong)
            };
            (0..count).map(of).collect()
        };
        Ok(ExampleSet { train: part("train", config.photos)?, validation: part("validation", validation)?, key })
    }
}

/// Makes the examples.
struct Maker<'a> {
    config: &'a BaselineConfig,
    sources: Sources,
    depth_net: &'a DepthNet,
    seed: u64,
    files: &'a ExampleFiles,
}

impl Maker<'_> {
    /// Makes and writes the examples of training.
    fn train(&self, on_event: OnEvent) -> Result<(), TrainError> {
        let Self { config, seed, files, .. } = *self;
        std::fs::create_dir_all(&files.folder).map_err(TrainError::io(&files.folder))?;
        let (depth_net, augmentation, probes) = (self.depth_net.clone(), config.variations(), config.probes);
        let prepare = move |sample: &lo_dataset::Sample, epoch: u64| {
            let (variation, _) = augmentation.variation(seed, sample, epoch);
            let mut stream = Variation::stream(seed, "baseline probes", sample, epoch);
            baseline_example(sample, &variation, &depth_net, probes, &mut stream)
        };
        let data = self.sources.all.clone();
        let prefetcher = Prefetcher::start(data, &config.data, seed, Vec::new(), LoaderState::default(), prepare);
        let mut prefetcher = prefetcher.map_err(TrainError::io(&files.folder))?;
        let total = config.photos as u64;
        let (mut unusable, begun) = (0, Instant::now());
        let mut emit = |event: Event| match on_event(event) {
            std::ops::ControlFlow::Continue(()) => Ok(()),
            std::ops::ControlFlow::Break(()) => Err(Cancelled),
        };
        emit(Event::Begun(READ_SAMPLES))?;
        let mut done = 0;
        while done < config.photos {
            match prefetcher.next().map_err(|_| TrainError::Empty)?.example {
                Ok(example) => {
                    unusable = 0;
                    files.write("train", done, &example)?;
                    done += 1;
                    emit(Event::Progress { stage: READ_SAMPLES, done: done as u64, total })?;
                }
                Err(SkippedSample { sample, error }) => {
                    unusable += 1;
                    if unusable == MAX_UNUSABLE {
                        return Err(TrainError::NoSamples { count: unusable, last: format!("{sample}: {error}") });
                    }
                    emit(Event::Warning(std::sync::Arc::new(TrainingWarning::SampleSkipped { sample, error })))?;
                }
            }
        }
        Ok(emit(Event::Done { stage: READ_SAMPLES, took: begun.elapsed() })?)
    }

    /// Makes and writes the examples of validation, and returns their number.
    fn validation(&self, on_event: OnEvent) -> Result<usize, TrainError> {
        let rooms = &self.sources.rooms;
        let mut count = 0;
        for index in indices_of(&**rooms, Some(Split::Validation), Some(self.config.validation.photos)) {
            let sample = rooms.get(index)?;
            let mut stream = Variation::stream(self.seed, "baseline probes", &sample, 0);
            match baseline_example(&sample, &Variation::NONE, self.depth_net, 0, &mut stream) {
                Ok(example) => {
                    self.files.write("validation", count, &example)?;
                    count += 1;
                }
                Err(error) => {
                    let (sample, error) = (sample.id, error.to_string());
                    warn(on_event, TrainingWarning::SampleSkipped { sample, error })?;
                }
            }
        }
        Ok(count)
    }
}
