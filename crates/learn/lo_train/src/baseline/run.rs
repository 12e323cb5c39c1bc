//! Runs a baseline's training, resumable at every step.

use std::collections::BTreeMap;
use std::ops::ControlFlow;
use std::path::Path;
use std::sync::Arc;
use std::time::{Duration, Instant};

use lo_baselines::{BaselineExample, BaselineNet, PROBE_MAP, fingerprint};
use lo_events::{Cancelled, Event, Figure, OnEvent};
use lo_geometry::{Vec3, pixel_direction};
use lo_imaging::RadianceImage;
use lo_metrics::panorama_psnr_db;
use lo_nets::Networks;
use lo_nets::checkpoint::Precision;
use lo_nets::conv::in_pool;
use lo_random::RngExt;
use serde_json::json;

use super::config::BaselineConfig;
use super::example_set::ExampleSet;
use super::trainer::{BaselineState, BaselineTrainer};
use crate::error::{StepError, TrainError};
use crate::learner::Progress;
use crate::log::Log;
use crate::request::{CHECKPOINT_FILE, LOG_FILE, WEIGHTS_FILE};
use crate::run::MAX_ROLLBACKS;
use crate::stages;
use crate::warning::TrainingWarning;

/// Input of a baseline's run beside its configuration.
#[derive(Clone, Copy, Debug)]
pub struct BaselineRequest<'a> {
    /// Folder of the run's files; must exist.
    pub folder: &'a Path,
    /// Folder of the examples' files. Runs with the same data, networks and seed share them.
    pub examples: &'a Path,
    /// Networks whose depth network computes the features; it is not trained.
    pub networks: &'a Networks,
    /// Whether to continue from the folder's checkpoint.
    pub resume: bool,
    /// Seed of all random choices. A resumed run keeps its own.
    pub seed: u64,
}

/// Trains a baseline, or stops after the current step if `on_event` asks for it.
///
/// A stopped run writes a checkpoint. Resumed, it computes the same weights to the bit as an uninterrupted run. Steps
/// and learning rate may change in between; the system, its data and the networks may not.
///
/// # Errors
/// See [`TrainError`].
pub fn train_baseline(config: &BaselineConfig, request: &BaselineRequest, on_event: OnEvent) -> Result<(), TrainError> {
    config.validate()?;
    let path = request.folder.join(CHECKPOINT_FILE);
    let resumed = request.resume.then(|| BaselineTrainer::read(&path)).transpose()?;
    let seed = resumed.as_ref().map_or(request.seed, |trainer| trainer.state.seed);
    let depth_net = fingerprint(&request.networks.depth);
    let other = |reason: &str| TrainError::NotThisRun { path: path.clone(), reason: reason.to_owned() };
    if let Some(trainer) = &resumed {
        if trainer.state.system != config.system {
            return Err(other(&format!("the run trains {}, not {}", trainer.state.system, config.system)));
        }
        if trainer.state.depth_net != depth_net {
            return Err(other("the run has features of other weights; give the weights that it was started with"));
        }
    }
    let examples = ExampleSet::open(config, request.examples, seed, request.networks, &depth_net, on_event)?;
    let key = format!("{:016x}", examples.key);
    let trainer = match resumed {
        Some(trainer) if trainer.state.examples != key => {
            return Err(other("the data, the probes or the augmentation changed; start a new run"));
        }
        Some(trainer) => trainer,
        None => {
            let features = examples.train[0].features.shape();
            BaselineTrainer::new(BaselineState {
                system: config.system,
                features,
                depth_net,
                seed,
                step: 0,
                averaged: 0,
                setbacks: 0,
                examples: key,
                log_bytes: 0,
            })
        }
    };
    let log_path = request.folder.join(LOG_FILE);
    let log = Log::open(&log_path, trainer.state.log_bytes).map_err(TrainError::io(&log_path))?;
    let (saved, rollbacks, cancelled) = (Instant::now(), 0, false);
    let same_size = Sizes::of(&examples.train);
    Run { config, request, on_event, cancelled, examples, same_size, trainer, log, saved, rollbacks }.run()
}

/// Indices of examples by the size of their features.
struct Sizes(BTreeMap<[usize; 2], Vec<usize>>);

impl Sizes {
    fn of(examples: &[BaselineExample]) -> Self {
        let mut sizes = BTreeMap::<_, Vec<usize>>::new();
        for (index, example) in examples.iter().enumerate() {
            sizes.entry(example.features.cells()).or_default().push(index);
        }
        Self(sizes)
    }
}

struct Run<'a, 'b> {
    config: &'a BaselineConfig,
    request: &'a BaselineRequest<'a>,
    on_event: OnEvent<'b>,
    cancelled: bool,
    examples: ExampleSet,
    same_size: Sizes,
    trainer: BaselineTrainer,
    log: Log,
    saved: Instant,
    /// Rollbacks since the checkpoint was written.
    rollbacks: u32,
}

impl Run<'_, '_> {
    fn run(&mut self) -> Result<(), TrainError> {
        let (config, stage, begun) = (self.config, self.config.stage(), Instant::now());
        if self.trainer.state.step == 0 {
            // A rollback needs a checkpoint.
            self.save()?;
        }
        self.emit(Event::Begun(stage.clone()));
        self.emit(Event::Progress { stage: stage.clone(), done: self.trainer.state.step, total: config.steps });
        while self.trainer.state.step < config.steps {
            if self.cancelled {
                self.save()?;
                return Err(Cancelled.into());
            }
            let step = self.trainer.state.step;
            let learning_rate = config.schedule().learning_rate_at(step);
            let indices = self.batch();
            let batch: Vec<&BaselineExample> = indices.iter().map(|&index| &self.examples.train[index]).collect();
            let progress = step as f32 / config.steps as f32;
            match self.trainer.step(&batch, progress, learning_rate, config.descent()) {
                Ok(progress) => self.finish_step(&progress, learning_rate)?,
                Err(error) => self.roll_back(error)?,
            }
        }
        self.validate()?;
        self.save()?;
        self.emit(Event::Done { stage, took: begun.elapsed() });
        Ok(())
    }

    /// Draws a batch of examples of one size.
    fn batch(&self) -> Vec<usize> {
        let BaselineState { seed, step, setbacks, .. } = self.trainer.state;
        let mut stream = lo_random::stream(seed, "baseline batch", step ^ (setbacks << 48));
        let first = stream.random_range(0..self.examples.train.len());
        let all = &self.same_size.0[&self.examples.train[first].features.cells()];
        let more = (1..self.config.batch_size).map(|_| all[stream.random_range(0..all.len())]);
        std::iter::once(first).chain(more).collect()
    }

    fn emit(&mut self, event: Event) {
        if (self.on_event)(event) == ControlFlow::Break(()) {
            self.cancelled = true;
        }
    }

    /// Counts and reports a completed step; then logs, validates and saves if due.
    fn finish_step(&mut self, progress: &Progress, learning_rate: f64) -> Result<(), TrainError> {
        self.trainer.state.step += 1;
        let (step, config, stage) = (self.trainer.state.step, self.config, self.config.stage());
        self.log.add(progress);
        let losses = self.log.losses(progress);
        self.emit(Event::Progress { stage: stage.clone(), done: step, total: config.steps });
        self.emit(Event::Figures { stage, figures: losses });
        let is_last = step == config.steps;
        if is_last || step.is_multiple_of(config.log_steps) {
            let means = self.log.means(config.phase(), step, step, learning_rate, Duration::ZERO);
            means.map_err(TrainError::io(&self.request.folder.join(LOG_FILE)))?;
        }
        if !is_last && step.is_multiple_of(config.validation.every_steps) {
            self.validate()?;
        }
        if self.saved.elapsed().as_secs_f64() > 60.0 * config.checkpoint_minutes {
            match self.trainer.net.check(config.system.name()) {
                Ok(()) => self.save()?,
                Err(error) => self.roll_back(error)?,
            }
        }
        Ok(())
    }

    /// Restores the last checkpoint after a failed step and continues with other batches.
    ///
    /// # Errors
    /// [`TrainError::Diverged`] after [`MAX_ROLLBACKS`] to one checkpoint.
    fn roll_back(&mut self, error: StepError) -> Result<(), TrainError> {
        let (phase, step) = (self.config.phase(), self.trainer.state.step);
        self.rollbacks += 1;
        if self.rollbacks > MAX_ROLLBACKS {
            return Err(TrainError::Diverged { phase, step, cause: error, times: MAX_ROLLBACKS });
        }
        let setbacks = self.trainer.state.setbacks + 1;
        self.trainer = BaselineTrainer::read(&self.request.folder.join(CHECKPOINT_FILE))?;
        self.trainer.state.setbacks = setbacks;
        self.log.restart();
        let (fault, back_to_step) = (error.to_string(), self.trainer.state.step);
        self.log
            .setback(phase, step, &fault, back_to_step)
            .map_err(TrainError::io(&self.request.folder.join(LOG_FILE)))?;
        self.emit(Event::Warning(Arc::new(TrainingWarning::SetBack { phase, step, fault, back_to_step })));
        Ok(())
    }

    /// Measures the panoramas of held-out rooms under the averaged weights.
    fn validate(&mut self) -> Result<(), TrainError> {
        if self.examples.validation.is_empty() {
            return Ok(());
        }
        let begun = Instant::now();
        self.emit(Event::Begun(stages::VALIDATION));
        let net = &self.trainer.net.average;
        let db: Vec<f64> = self.examples.validation.iter().filter_map(|example| self.psnr_db(net, example)).collect();
        let psnr_db = db.iter().sum::<f64>() / db.len().max(1) as f64;
        let (step, phase) = (self.trainer.state.step, self.config.phase().to_string());
        let line = json!({ "phase": phase, "step": step, "validation": { "photos": db.len(), "psnr_db": psnr_db } });
        self.log.line(&line).map_err(TrainError::io(&self.request.folder.join(LOG_FILE)))?;
        let figures = vec![Figure { name: "psnr_db", value: psnr_db }];
        self.emit(Event::Figures { stage: stages::VALIDATION, figures });
        self.emit(Event::Done { stage: stages::VALIDATION, took: begun.elapsed() });
        Ok(())
    }

    /// Returns the mean PSNR over a photo's panoramas, at the resolution of probes.
    fn psnr_db(&self, net: &BaselineNet, example: &BaselineExample) -> Option<f64> {
        let prediction = in_pool(|| net.predict(&example.features));
        let [width, height] = PROBE_MAP;
        let directions: Vec<Vec3> =
            (0..width * height).map(|i| pixel_direction(i % width, i / width, width, height)).collect();
        let db = example.probes.iter().filter_map(|probe| {
            let radiance = prediction.radiance(probe.position_m, &directions);
            panorama_psnr_db(&probe.radiance, &RadianceImage::new(width, height, radiance))
        });
        let db: Vec<f64> = db.collect();
        (!db.is_empty()).then(|| db.iter().sum::<f64>() / db.len() as f64)
    }

    /// Writes the checkpoint and the averaged weights, each atomically.
    fn save(&mut self) -> Result<(), TrainError> {
        let begun = Instant::now();
        self.emit(Event::Begun(stages::CHECKPOINT));
        self.trainer.state.log_bytes = self.log.bytes();
        self.trainer.write(&self.request.folder.join(CHECKPOINT_FILE))?;
        let path = self.request.folder.join(WEIGHTS_FILE);
        self.trainer.exported().write(&path, Precision::Half)?;
        self.rollbacks = 0;
        self.saved = Instant::now();
        self.emit(Event::Done { stage: stages::CHECKPOINT, took: begun.elapsed() });
        Ok(())
    }
}
