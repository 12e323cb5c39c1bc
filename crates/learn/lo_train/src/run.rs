//! Runs the phases of a training run, resumable at every step.

mod steps;

use std::ops::ControlFlow;
use std::path::Path;
use std::sync::Arc;
use std::time::{Duration, Instant};

use lo_dataset::{LoaderState, Sample, fingerprint};
use lo_events::{Cancelled, Event, OnEvent, warn};
use lo_imaging::write_rgba8;
use lo_nets::checkpoint::Precision;
use lo_nets::conv::{in_bf16, in_pool};
use serde_json::json;

use crate::batcher::Batcher;
use crate::config::TrainConfig;
use crate::encoder_weights::{EncoderOrigin, read_encoder};
use crate::error::{ConfigError, StepError, TrainError};
use crate::example::{DepthExample, UnusableSample};
use crate::learner::{Learner, Progress};
use crate::log::Log;
use crate::phases::Phase;
use crate::prefetch::{Prefetcher, SkippedSample};
use crate::prepare::{depth_examples, joint_examples, light_examples};
use crate::request::{CHECKPOINT_FILE, InitialWeights, LOG_FILE, SHEET_FILE, TrainRequest, WEIGHTS_FILE};
use crate::sources::Sources;
use crate::stages;
use crate::state::RunState;
use crate::training_phase::TrainingPhase;
use crate::validation::Validation;
use crate::warning::TrainingWarning;

/// Generator named in the contact sheet's metadata.
const GENERATOR: &str = "lightoctree-lab train";

/// Consecutive unusable samples after which the run fails.
const MAX_UNUSABLE: u64 = 1000;

/// Rollbacks to one checkpoint after which the run fails.
pub(crate) const MAX_ROLLBACKS: u32 = 5;

/// Trains all phases, or stops after the current step if `on_event` asks for it.
///
/// A stopped run writes a checkpoint. Resumed, it computes the same weights to the bit as an uninterrupted run, for
/// every number of threads. The configuration may change in between, except for the networks' shapes and completed
/// phases.
///
/// # Errors
/// See [`TrainError`].
pub fn train(config: &TrainConfig, request: &TrainRequest, on_event: OnEvent) -> Result<(), TrainError> {
    config.validate()?;
    let phases = config.phases();
    if phases.is_empty() {
        return Err(ConfigError::NoPhases.into());
    }
    let mut run = Run::new(config, request, phases, on_event)?;
    while run.state.phase < run.phases.len() {
        run.phase()?;
    }
    Ok(())
}

struct Run<'a> {
    config: &'a TrainConfig,
    folder: &'a Path,
    sources: Sources,
    phases: Vec<(TrainingPhase, Phase)>,
    on_event: OnEvent<'a>,
    /// Whether the event handler asked the run to stop.
    cancelled: bool,
    learner: Learner,
    state: RunState,
    log: Log,
    validation: Option<Validation>,
    saved: Instant,
    /// Rollbacks since the checkpoint was written.
    rollbacks: u32,
}

impl<'a> Run<'a> {
    fn new(
        config: &'a TrainConfig,
        request: &TrainRequest<'a>,
        phases: Vec<(TrainingPhase, Phase)>,
        on_event: OnEvent<'a>,
    ) -> Result<Self, TrainError> {
        let folder = request.folder;
        let resumed = request.resume.then(|| RunState::read(&folder.join(CHECKPOINT_FILE))).transpose()?;
        // Rooms that are generated on the fly depend on the seed too.
        let seed = resumed.as_ref().map_or(request.seed, |(_, state)| state.seed);
        let (sources, mut cancelled) = (Sources::open(&config.data, seed)?, false);
        let fingerprint = fingerprint(&*sources.all);
        let (learner, state) = match resumed {
            Some((learner, state)) if state.fingerprint == fingerprint => (learner, state),
            Some((learner, state)) => {
                let position = LoaderState { epoch: state.position.epoch + 1, ..LoaderState::default() };
                cancelled = warn(on_event, TrainingWarning::DatasetChanged { epoch: position.epoch }).is_err();
                (learner, RunState { position, waiting: Vec::new(), fingerprint, ..state })
            }
            None => {
                let first_depth = phases.iter().find_map(|(_, phase)| phase.octree_depth());
                let octree_depth = first_depth.unwrap_or(config.network.depth);
                let mut learner = Learner::new(config, octree_depth, seed).map_err(ConfigError::from)?;
                let mut state = RunState::new(seed, fingerprint);
                match request.start {
                    InitialWeights::Random => {}
                    InitialWeights::DepthNetwork(path) => learner.load_depth(path, config)?,
                    InitialWeights::Networks(path) => learner.load(path, config, seed)?,
                    InitialWeights::Encoder(path) => {
                        let (weights, origin) = read_encoder(path, config.encoder)?;
                        learner.load_encoder(&weights)?;
                        if !origin.is_published(config.encoder) {
                            let EncoderOrigin { file, sha256 } = origin.clone();
                            cancelled = warn(on_event, TrainingWarning::UnpublishedEncoder { file, sha256 }).is_err();
                        }
                        state.encoder_origin = Some(origin);
                    }
                }
                (learner, state)
            }
        };
        let log_path = folder.join(LOG_FILE);
        let log = Log::open(&log_path, state.log_bytes).map_err(TrainError::io(&log_path))?;
        let (saved, rollbacks) = (Instant::now(), 0);
        Ok(Self {
            config,
            folder,
            sources,
            phases,
            on_event,
            cancelled,
            learner,
            state,
            log,
            validation: None,
            saved,
            rollbacks,
        })
    }

    /// Trains the rest of the current phase.
    fn phase(&mut self) -> Result<(), TrainError> {
        let (name, phase) = self.phases[self.state.phase].clone();
        if self.state.step == 0 {
            if let Some(depth) = phase.octree_depth() {
                self.learner.set_octree_depth(self.config, depth, self.state.seed).map_err(ConfigError::from)?;
            }
            // A rollback in this phase needs a checkpoint.
            self.save()?;
        }
        let (stage, begun) = (name.stage(), Instant::now());
        self.emit(Event::Begun(stage.clone()));
        self.emit(Event::Progress { stage: stage.clone(), done: self.state.step, total: phase.steps() });
        self.freeze_statistics();
        let (seed, augmentation) = (self.state.seed, &self.config.augmentation);
        match &phase {
            Phase::Depth(depth) => {
                let prepare = depth_examples(depth, augmentation, seed);
                self.steps(&phase, prepare, DepthExample::size, |run, examples, learning_rate| {
                    let config = run.config;
                    let step = || run.learner.depth_step(&examples, learning_rate, depth, config);
                    in_pool(|| in_bf16(config.bf16, step)).map(Ok)
                })?;
            }
            Phase::Light(light) => {
                let prepare = light_examples(light, augmentation, &self.learner, seed);
                self.steps(
                    &phase,
                    prepare,
                    |_| [0; 2],
                    |run, mut examples, learning_rate| {
                        let (example, global) = examples.swap_remove(0);
                        let predicted = run.uses_predicted_growth(light);
                        in_pool(|| run.learner.light_step(&example, global, predicted, learning_rate, run.config))
                            .map(Ok)
                    },
                )?;
            }
            Phase::Expected(expected) => self.expected_steps(expected)?,
            Phase::Joint(joint) => {
                let prepare = joint_examples(joint, augmentation, &self.learner, seed);
                self.steps(
                    &phase,
                    prepare,
                    |_| [0; 2],
                    |run, mut examples, learning_rate| run.joint_step(joint, examples.swap_remove(0), learning_rate),
                )?;
            }
        }
        self.validate()?;
        self.emit(Event::Done { stage, took: begun.elapsed() });
        self.state.phase += 1;
        self.state.step = 0;
        // A following phase saves at its start.
        if self.state.phase == self.phases.len() {
            self.save()?;
        }
        Ok(())
    }

    /// Emits an event and records a request to stop.
    fn emit(&mut self, event: Event) {
        if (self.on_event)(event) == ControlFlow::Break(()) {
            self.cancelled = true;
        }
    }

    fn warn(&mut self, warning: TrainingWarning) {
        self.emit(Event::Warning(Arc::new(warning)));
    }

    /// Runs the steps of a phase, each on a batch of examples of one size.
    fn steps<T: Send + 'static>(
        &mut self,
        phase: &Phase,
        prepare: impl FnMut(&Sample, u64) -> Result<T, UnusableSample> + Send + 'static,
        size: fn(&T) -> [usize; 2],
        mut step: impl FnMut(&mut Self, Vec<T>, f64) -> Result<Result<Progress, SkippedSample>, StepError>,
    ) -> Result<(), TrainError> {
        let RunState { seed, position, ref waiting, .. } = self.state;
        let prefetcher =
            Prefetcher::start(self.sources.all.clone(), &self.config.data, seed, waiting.clone(), position, prepare);
        let mut batcher = Batcher::new(phase.batch_size());
        let mut prefetcher = prefetcher.map_err(TrainError::io(self.folder))?;
        let (mut unusable, mut waited) = (0, Duration::ZERO);
        while self.state.step < phase.steps() {
            if self.cancelled {
                drop(prefetcher);
                self.save()?;
                return Err(Cancelled.into());
            }
            let examples = loop {
                let prepared = prefetcher.next().map_err(|_| TrainError::Empty)?;
                self.state.position = prepared.next;
                match prepared.example {
                    Ok(example) => {
                        if let Some(batch) = batcher.add(prepared.at, size(&example), example) {
                            break batch;
                        }
                    }
                    Err(skipped) => self.skip(skipped, &mut unusable)?,
                }
            };
            self.state.waiting = batcher.waiting();
            waited += prefetcher.take_waited();
            let learning_rate = phase.schedule().learning_rate_at(self.state.step);
            match step(self, examples, learning_rate) {
                Ok(Ok(progress)) => {
                    unusable = 0;
                    self.finish_step(&progress, learning_rate, &mut waited)?;
                }
                Ok(Err(skipped)) => self.skip(skipped, &mut unusable)?,
                Err(error) => self.roll_back(error)?,
            }
        }
        Ok(())
    }

    /// Reports an unusable sample.
    ///
    /// # Errors
    /// [`TrainError::NoSamples`] after [`MAX_UNUSABLE`] in a row.
    fn skip(&mut self, skipped: SkippedSample, unusable: &mut u64) -> Result<(), TrainError> {
        let SkippedSample { sample, error } = skipped;
        *unusable += 1;
        if *unusable == MAX_UNUSABLE {
            return Err(TrainError::NoSamples { count: *unusable, last: format!("{sample}: {error}") });
        }
        self.warn(TrainingWarning::SampleSkipped { sample, error });
        Ok(())
    }

    /// Counts and reports a completed step; then logs, validates and saves if due.
    fn finish_step(
        &mut self,
        progress: &Progress,
        learning_rate: f64,
        waited: &mut Duration,
    ) -> Result<(), TrainError> {
        self.state.step += 1;
        self.state.total_steps += 1;
        self.log.add(progress);
        let losses = self.log.losses(progress);
        let (name, total) = (self.phases[self.state.phase].0, self.phases[self.state.phase].1.steps());
        self.emit(Event::Progress { stage: name.stage(), done: self.state.step, total });
        self.emit(Event::Figures { stage: name.stage(), figures: losses });
        let last = self.state.step == total;
        if last || self.state.step.is_multiple_of(self.config.log_steps) {
            let means =
                self.log.means(name, self.state.step, self.state.total_steps, learning_rate, std::mem::take(waited));
            means.map_err(TrainError::io(&self.folder.join(LOG_FILE)))?;
        }
        if !last && self.state.step.is_multiple_of(self.config.validation.every_steps) {
            self.validate()?;
        }
        if self.saved.elapsed().as_secs_f64() > 60.0 * self.config.checkpoint_minutes {
            match self.learner.check() {
                Ok(()) => self.save()?,
                Err(error) => self.roll_back(error)?,
            }
        }
        Ok(())
    }

    /// Restores the last checkpoint after a failed step and continues with the next samples.
    ///
    /// # Errors
    /// [`TrainError::Diverged`] after [`MAX_ROLLBACKS`] to one checkpoint.
    fn roll_back(&mut self, error: StepError) -> Result<(), TrainError> {
        let (phase, step) = (self.phases[self.state.phase].0, self.state.step);
        self.rollbacks += 1;
        if self.rollbacks > MAX_ROLLBACKS {
            return Err(TrainError::Diverged { phase, step, cause: error, times: MAX_ROLLBACKS });
        }
        let (learner, state) = RunState::read(&self.folder.join(CHECKPOINT_FILE))?;
        let RunState { position, fingerprint, setbacks, ref mut waiting, .. } = self.state;
        let (waiting, setbacks) = (std::mem::take(waiting), setbacks + 1);
        self.learner = learner;
        self.state = RunState { position, waiting, setbacks, fingerprint, ..state };
        self.freeze_statistics();
        self.log.restart();
        let (fault, back_to_step) = (error.to_string(), self.state.step);
        self.log.setback(phase, step, &fault, back_to_step).map_err(TrainError::io(&self.folder.join(LOG_FILE)))?;
        self.warn(TrainingWarning::SetBack { phase, step, fault, back_to_step });
        Ok(())
    }

    /// Sets whether the encoder normalises by running statistics in the current phase.
    fn freeze_statistics(&mut self) {
        match &self.phases[self.state.phase].1 {
            Phase::Depth(depth) => self.learner.freeze_statistics(depth.frozen_statistics),
            Phase::Joint(_) => self.learner.freeze_statistics(true),
            Phase::Light(_) | Phase::Expected(_) => {}
        }
    }

    /// Measures held-out photos, logs the report and writes the contact sheet.
    fn validate(&mut self) -> Result<(), TrainError> {
        let (name, with_light) =
            (self.phases[self.state.phase].0, !matches!(self.phases[self.state.phase].1, Phase::Depth(_)));
        let config = &self.config.validation;
        if config.photos == 0 {
            return Ok(());
        }
        self.emit(Event::Begun(stages::VALIDATION));
        let (sources, on_event, cancelled) = (&self.sources, &mut self.on_event, &mut self.cancelled);
        let validation = self.validation.get_or_insert_with(|| {
            Validation::new(&*sources.rooms, &*sources.panoramas, config.photos, config.sheet_rows, |warning| {
                *cancelled |= warn(on_event, warning).is_err();
            })
        });
        let begun = Instant::now();
        let (report, sheet) = validation.run(&self.learner, with_light);
        let took = begun.elapsed();
        let seconds = (took.as_secs_f64() * 10.0).round() / 10.0;
        let line = json!({ "phase": name.to_string(), "step": self.state.step, "total_steps": self.state.total_steps,
            "validation": report, "seconds": seconds });
        self.log.line(&line).map_err(TrainError::io(&self.folder.join(LOG_FILE)))?;
        if let Some(sheet) = sheet {
            let rgba = sheet.map(|&[r, g, b]| [r, g, b, 255]);
            write_rgba8(self.folder.join(SHEET_FILE), &rgba, GENERATOR)?;
        }
        self.emit(Event::Figures { stage: stages::VALIDATION, figures: report.figures() });
        self.emit(Event::Done { stage: stages::VALIDATION, took });
        Ok(())
    }

    /// Writes the checkpoint and the averaged weights, each atomically.
    fn save(&mut self) -> Result<(), TrainError> {
        let begun = Instant::now();
        self.emit(Event::Begun(stages::CHECKPOINT));
        self.state.log_bytes = self.log.bytes();
        self.state.write(&self.learner, &self.folder.join(CHECKPOINT_FILE))?;
        self.learner.averages().write(self.folder.join(WEIGHTS_FILE), Precision::Half)?;
        self.rollbacks = 0;
        self.saved = Instant::now();
        self.emit(Event::Done { stage: stages::CHECKPOINT, took: begun.elapsed() });
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use lo_dataset::GeneratorConfig;
    use lo_nets::light::LightNetConfig;
    use lo_synth::SynthConfig;

    use lo_nets::checkpoint::Checkpoint;

    use super::*;
    use crate::config::{DataConfig, ValidationConfig};
    use crate::phases::{LightPhase, Schedule};

    #[test]
    fn a_weight_that_is_no_number_is_named_and_the_run_goes_back() {
        let room = SynthConfig { crop_size: [64, 48], ..SynthConfig::default() };
        let small = GeneratorConfig {
            room,
            shots: 1,
            panoramas: 1,
            panorama_height: 16,
            octree_depth: 5,
            ..Default::default()
        };
        let network = LightNetConfig { depth: 4, full_depth: 3, channels: 8, max_channels: 16, ..Default::default() };
        let config = TrainConfig {
            network: LightNetConfig { bottleneck: 2, head_channels: 8, global_features: 8, ..network },
            data: DataConfig { generated_rooms: 12, generator: small, ..DataConfig::default() },
            validation: ValidationConfig { photos: 0, ..ValidationConfig::default() },
            depth: Vec::new(),
            light: vec![LightPhase {
                schedule: Schedule { steps: 3, ..LightPhase::DEFAULT.schedule },
                octree_depth: 4,
                ..LightPhase::DEFAULT
            }],
            joint: Vec::new(),
            ..TrainConfig::default()
        };
        let folder = tempfile::tempdir().unwrap();
        let request = TrainRequest { folder: folder.path(), resume: false, seed: 1, start: InitialWeights::Random };
        let (mut steps, mut warnings) = (0, Vec::new());
        let phases = config.phase_stages();
        let mut on_event = |event: Event| {
            warnings.extend(event.warning().cloned());
            match event {
                Event::Figures { stage, .. } if phases.contains(&stage) => {
                    steps += 1;
                    if steps == 1 { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
                }
                _ => ControlFlow::Continue(()),
            }
        };
        let mut run = Run::new(&config, &request, config.phases(), &mut on_event).unwrap();
        assert!(matches!(run.phase(), Err(TrainError::Cancelled(_))));
        run.cancelled = false;

        let mut poisoned = Checkpoint::default();
        poisoned.add_module("light", &run.learner.light.net);
        poisoned.insert("light.global.weights", &[8, 8], vec![f32::NAN; 64]);
        run.learner.light.net = poisoned.load_module("light", run.learner.light.net.clone()).unwrap();
        let error = run.learner.check().unwrap_err();
        assert_eq!(error.to_string(), "light_net.global.weights is not finite");

        run.phase().unwrap();
        assert_eq!((run.state.setbacks, run.state.total_steps), (1, 3));
        assert!(run.learner.check().is_ok());
        drop(run);
        assert_eq!(steps, 3);
        let [TrainingWarning::SetBack { phase, step: 1, fault, back_to_step: 1 }] = &warnings[..] else {
            panic!("{warnings:?}");
        };
        assert_eq!(phase.to_string(), "light");
        assert!(fault.contains("light_net."), "{fault}");
        let log = std::fs::read_to_string(folder.path().join(LOG_FILE)).unwrap();
        assert!(log.contains("\"back_to_step\":1"), "{log}");
    }
}
