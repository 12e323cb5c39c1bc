//! The pool of a run's examples, prepared once and kept in files.

use std::path::{Path, PathBuf};
use std::time::Instant;

use lo_baselines::BaselineExample;
use lo_dataset::stages::READ_SAMPLES;
use lo_dataset::{LoaderState, Split, fingerprint as dataset_fingerprint, indices_of};
use lo_events::{Cancelled, Event, OnEvent, warn};
use lo_nets::Networks;
use lo_nets::checkpoint::{Checkpoint, Precision};
use lo_nets::depth::DepthNet;
use serde_json::json;

use super::config::BaselineConfig;
use super::example::baseline_example;
use crate::augmentation::Variation;
use crate::config::DataConfig;
use crate::error::TrainError;
use crate::prefetch::{Prefetcher, SkippedSample};
use crate::sources::Sources;
use crate::warning::TrainingWarning;

/// Describes the examples of a folder.
const LIST: &str = "examples.json";

/// Changes whenever examples are made differently.
const VERSION: u32 = 1;

/// Key of the loader's next position in the state of an example's file.
const NEXT: &str = "next";

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
    /// Reads the examples from a subfolder of `folder` that is named by their key, and makes and writes those that it
    /// lacks. Neither the system nor the number of photos is part of the key: all systems share their examples, and a
    /// smaller pool is the beginning of a larger one. `depth_net` is the fingerprint of the networks' depth network.
    ///
    /// # Errors
    /// Unreadable data, files that cannot be read or written, cancellation. What was made until then is kept.
    pub fn open(
        config: &BaselineConfig,
        folder: &Path,
        seed: u64,
        networks: &Networks,
        depth_net: &str,
        on_event: OnEvent,
    ) -> Result<Self, TrainError> {
        let sources = Sources::open(&config.data, seed)?;
        // Crops depend on the configuration, rooms of a folder on the folder's content alone.
        let crops = DataConfig { folder: None, threads: 1, prefetch: 1, ..config.data.clone() };
        let description = json!({
            "version": VERSION,
            "rooms_and_places": format!("{:016x}", dataset_fingerprint(&*sources.all)),
            "data": crops,
            "depth_net": depth_net,
            "seed": seed,
            "probes": config.probes,
            "augmentation": config.variations(),
        });
        let key = lo_random::hash(description.to_string().as_bytes());
        let folder = folder.join(format!("{key:016x}"));
        std::fs::create_dir_all(&folder).map_err(TrainError::io(&folder))?;
        let list = folder.join(LIST);
        lo_imaging::write_atomically(&list, |out| {
            std::io::Write::write_all(out, format!("{description:#}\n").as_bytes())
        })
        .map_err(TrainError::io(&list))?;
        let files = ExampleFiles { folder };
        let maker = Maker { config, sources, depth_net: &networks.depth, seed, files: &files };
        maker.train(on_event)?;
        let validation = maker.validation(on_event)?;
        // Those just made are read, too, so that they are as rounded as those of a resumed run.
        let train = (0..config.photos).map(|index| files.read(TRAIN, index)).collect::<Result<_, _>>()?;
        Ok(Self { train, validation, key })
    }
}

/// Names of the parts in file names.
const TRAIN: &str = "train";
const VALIDATION: &str = "validation";

/// Files of examples in one folder.
struct ExampleFiles {
    folder: PathBuf,
}

impl ExampleFiles {
    fn path(&self, part: &str, index: usize) -> PathBuf {
        self.folder.join(format!("{part}-{index:06}.safetensors"))
    }

    /// Returns how many examples of training there are, and the loader's position after the last one.
    fn made(&self) -> Result<(usize, LoaderState), TrainError> {
        let count = (0..).take_while(|&index| self.path(TRAIN, index).exists()).count();
        if count == 0 {
            return Ok((0, LoaderState::default()));
        }
        let path = self.path(TRAIN, count - 1);
        let state = Checkpoint::read(&path)?.state;
        let next = serde_json::from_value(state[NEXT].clone()).map_err(|error| wrong(&path, error))?;
        Ok((count, next))
    }

    fn write(&self, part: &str, index: usize, example: &BaselineExample, next: LoaderState) -> Result<(), TrainError> {
        let mut file = example.to_checkpoint();
        file.state = json!({ NEXT: next });
        Ok(file.write(self.path(part, index), Precision::Half)?)
    }

    fn read(&self, part: &str, index: usize) -> Result<BaselineExample, TrainError> {
        let path = self.path(part, index);
        BaselineExample::from_checkpoint(&Checkpoint::read(&path)?).map_err(|error| wrong(&path, error))
    }
}

fn wrong(path: &Path, error: impl ToString) -> TrainError {
    TrainError::NotThisRun { path: path.to_owned(), reason: error.to_string() }
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
    /// Makes and writes the examples of training that are missing.
    fn train(&self, on_event: OnEvent) -> Result<(), TrainError> {
        let Self { config, seed, files, .. } = *self;
        let (mut done, begin) = files.made()?;
        if done >= config.photos {
            return Ok(());
        }
        let (depth_net, augmentation, probes) = (self.depth_net.clone(), config.variations(), config.probes);
        let prepare = move |sample: &lo_dataset::Sample, epoch: u64| {
            let (variation, _) = augmentation.variation(seed, sample, epoch);
            let mut stream = Variation::stream(seed, "baseline probes", sample, epoch);
            baseline_example(sample, &variation, &depth_net, probes, &mut stream)
        };
        let data = self.sources.all.clone();
        let prefetcher = Prefetcher::start(data, &config.data, seed, Vec::new(), begin, prepare);
        let mut prefetcher = prefetcher.map_err(TrainError::io(&files.folder))?;
        let total = config.photos as u64;
        let (mut unusable, begun) = (0, Instant::now());
        let mut emit = |event: Event| match on_event(event) {
            std::ops::ControlFlow::Continue(()) => Ok(()),
            std::ops::ControlFlow::Break(()) => Err(Cancelled),
        };
        emit(Event::Begun(READ_SAMPLES))?;
        while done < config.photos {
            let prepared = prefetcher.next().map_err(|_| TrainError::Empty)?;
            match prepared.example {
                Ok(example) => {
                    unusable = 0;
                    files.write(TRAIN, done, &example, prepared.next)?;
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

    /// Returns the examples of validation, and makes and writes those that are missing.
    fn validation(&self, on_event: OnEvent) -> Result<Vec<BaselineExample>, TrainError> {
        let (rooms, files) = (&self.sources.rooms, self.files);
        let mut examples = Vec::new();
        for index in indices_of(&**rooms, Some(Split::Validation), Some(self.config.validation.photos)) {
            if !files.path(VALIDATION, index).exists() {
                let sample = rooms.get(index)?;
                let mut stream = Variation::stream(self.seed, "baseline probes", &sample, 0);
                match baseline_example(&sample, &Variation::NONE, self.depth_net, 0, &mut stream) {
                    Ok(example) => files.write(VALIDATION, index, &example, LoaderState::default())?,
                    Err(error) => {
                        let (sample, error) = (sample.id, error.to_string());
                        warn(on_event, TrainingWarning::SampleSkipped { sample, error })?;
                        continue;
                    }
                }
            }
            examples.push(files.read(VALIDATION, index)?);
        }
        Ok(examples)
    }
}
