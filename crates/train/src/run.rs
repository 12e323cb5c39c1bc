//! A run: phase by phase, step by step, resumable at any.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::{Duration, Instant};

use burn::tensor::Tensor;
use dataset::{CropModel, Dataset, Generated, Generator, Layout, LoaderState, Sample, fingerprint};
use imaging::write_rgba8;
use nets::checkpoint::{Checkpoint, Precision};
use nets::conv::in_bf16;
use nets::depth::{LONGER_SIDE, looked_at};
use random::RngExt;
use serde::{Deserialize, Serialize};
use serde_json::json;

use crate::augmentation::Variation;
use crate::config::{JointPhase, LightPhase, Phase, TrainConfig, between};
use crate::example::{DepthExample, KnownDepth, LightExample, RayCounts};
use crate::feed::{Batches, Feed};
use crate::learner::{Fault, Learner, LearnerState, Progress, in_pool};
use crate::log::Log;
use crate::validation::Validation;
use crate::{Message, TrainError};

/// Everything that is needed to go on.
pub const CHECKPOINT_FILE: &str = "checkpoint.safetensors";
/// The averaged weights in 16 bits, for use.
pub const WEIGHTS_FILE: &str = "weights.safetensors";
/// One line of JSON for every few steps, validation and incident.
pub const LOG_FILE: &str = "log.jsonl";
/// The last validation's pictures.
pub const SHEET_FILE: &str = "sheet.png";

/// Under which name a run's state is in its checkpoint.
const STATE: &str = "training";

/// Samples in a row that cannot be used before the run gives up.
const MOST_UNUSABLE: u64 = 1000;

/// Times that a run goes back to the same checkpoint before it gives up.
const MOST_SETBACKS: u32 = 5;

/// How a run ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Outcome {
    /// All phases are done.
    Done,
    /// It was asked to stop, and can be resumed.
    Stopped,
}

/// Where a run stands, but for the weights.
#[derive(Clone, Debug, Serialize, Deserialize)]
struct RunState {
    seed: u64,
    /// Which phase, counted from 0.
    phase: usize,
    /// Its steps that are done.
    step: u64,
    /// Steps of all phases that are done.
    total_steps: u64,
    /// How often the run went back; chance after it is another.
    setbacks: u64,
    /// Where the next sample stands, and in which dataset.
    position: LoaderState,
    /// Where samples before it stand that wait for others of their size.
    #[serde(default)]
    waiting: Vec<LoaderState>,
    fingerprint: u64,
    log_bytes: u64,
    learner: Option<LearnerState>,
}

/// What a run is asked for beside its configuration.
#[derive(Debug)]
pub struct Request<'a> {
    /// Folder of the run's files; it exists.
    pub folder: &'a Path,
    /// Go on from the folder's checkpoint.
    pub resume: bool,
    /// Seed of all chance; a resumed run keeps its own.
    pub seed: u64,
    /// Trained weights of all networks to begin with.
    pub weights: Option<&'a Path>,
    /// Weights of torchvision's `densenet121` to begin with.
    pub encoder_weights: Option<&'a Path>,
}

/// Trains until all phases are done or `stop` says so.
///
/// A resumed run goes on as if it had not been interrupted: the same weights to the bit, for every number of threads. The configuration may
/// have changed meanwhile, but not the networks' shapes, nor the phases that are done.
///
/// # Errors
/// See [`TrainError`].
pub fn train(
    config: &TrainConfig,
    request: &Request,
    stop: &dyn Fn() -> bool,
    messages: &mut dyn FnMut(Message),
) -> Result<Outcome, TrainError> {
    config.validate().map_err(TrainError::Config)?;
    let phases = config.phases();
    if phases.is_empty() {
        return Err(TrainError::Config("there are no phases: none of depth, light and joint is given".into()));
    }
    let mut run = Run::new(config, request, phases, messages)?;
    while run.state.phase < run.phases.len() {
        if run.phase(stop)? == Outcome::Stopped {
            return Ok(Outcome::Stopped);
        }
    }
    Ok(Outcome::Done)
}

fn open(config: &TrainConfig, seed: u64) -> Result<Arc<dyn Dataset>, TrainError> {
    let data = &config.data;
    Ok(match &data.folder {
        Some(folder) => Layout::detect(folder)?.open(folder, CropModel { seed, ..CropModel::default() })?.into(),
        None => {
            let generator = Generator::new(seed, data.generator.clone()).map_err(TrainError::Config)?;
            Arc::new(Generated::new(generator, data.generated_rooms))
        }
    })
}

struct Run<'a> {
    config: &'a TrainConfig,
    folder: &'a Path,
    dataset: Arc<dyn Dataset>,
    phases: Vec<(String, Phase)>,
    messages: &'a mut dyn FnMut(Message),
    learner: Learner,
    state: RunState,
    log: Log,
    validation: Option<Validation>,
    saved: Instant,
    /// Setbacks since the checkpoint was written.
    setbacks_here: u32,
}

/// A sample whose light example has to wait for the depth network.
struct JointExample {
    sample: Sample,
    variation: Variation,
    epoch: u64,
    depth: DepthExample,
    /// Where depth is known already.
    light: Option<LightExample>,
}

impl<'a> Run<'a> {
    fn new(
        config: &'a TrainConfig,
        request: &Request<'a>,
        phases: Vec<(String, Phase)>,
        messages: &'a mut dyn FnMut(Message),
    ) -> Result<Self, TrainError> {
        let folder = request.folder;
        let resumed = request.resume.then(|| read(&folder.join(CHECKPOINT_FILE))).transpose()?;
        // Rooms that are generated on the fly depend on it too.
        let seed = resumed.as_ref().map_or(request.seed, |(_, state)| state.seed);
        let dataset = open(config, seed)?;
        let fingerprint = fingerprint(&*dataset);
        let (learner, state) = match resumed {
            Some((learner, state)) if state.fingerprint == fingerprint => (learner, state),
            Some((learner, state)) => {
                messages(Message::Note("the dataset is not what it was; its next epoch begins".into()));
                let position = LoaderState { epoch: state.position.epoch + 1, ..LoaderState::default() };
                (learner, RunState { position, waiting: Vec::new(), fingerprint, ..state })
            }
            None => {
                let first_depth = phases.iter().find_map(|(_, phase)| phase.octree_depth());
                let octree_depth = first_depth.unwrap_or(config.network.depth);
                let mut learner = Learner::new(config, octree_depth, seed).map_err(TrainError::Config)?;
                if let Some(path) = request.weights {
                    learner.load(path, config, seed)?;
                }
                if let Some(path) = request.encoder_weights {
                    learner.load_encoder(&Checkpoint::read(path)?)?;
                }
                (learner, RunState::new(seed, fingerprint))
            }
        };
        let log_path = folder.join(LOG_FILE);
        let log = Log::open(&log_path, state.log_bytes).map_err(TrainError::io(&log_path))?;
        let (saved, setbacks_here) = (Instant::now(), 0);
        Ok(Self {
            config,
            folder,
            dataset,
            phases,
            messages,
            learner,
            state,
            log,
            validation: None,
            saved,
            setbacks_here,
        })
    }

    /// The rest of the phase at hand.
    fn phase(&mut self, stop: &dyn Fn() -> bool) -> Result<Outcome, TrainError> {
        let (name, phase) = self.phases[self.state.phase].clone();
        if self.state.step == 0 {
            if let Some(depth) = phase.octree_depth() {
                self.learner.deepen(self.config, depth, self.state.seed).map_err(TrainError::Config)?;
            }
            // Whatever happens, there is something to go back to.
            self.save()?;
        }
        (self.messages)(Message::Phase { name, steps: phase.steps(), done: self.state.step });
        let outcome = match &phase {
            Phase::Depth(depth) => {
                self.learner.freeze_statistics(depth.frozen_statistics);
                let (seed, augmentation, width) =
                    (self.state.seed, self.config.augmentation.clone(), depth.photo_width);
                let prepare = move |sample: &Sample, epoch: u64| {
                    let variation = augmentation.of(seed, sample, epoch).0;
                    DepthExample::new(sample, &variation, width).map_err(|error| error.to_string())
                };
                self.steps(&phase, prepare, DepthExample::size, stop, |run, examples, rate| {
                    let config = run.config;
                    in_pool(|| in_bf16(config.bf16, || run.learner.depth_step(&examples, rate, config))).map(Ok)
                })
            }
            Phase::Light(light) => {
                let prepare = self.prepare_light(light);
                let (growth, steps) = (light.own_growth, light.steps);
                self.steps(
                    &phase,
                    prepare,
                    |_| [0; 2],
                    stop,
                    move |run, mut examples, rate| {
                        let (example, global) = examples.swap_remove(0);
                        let own = run.grows_itself(growth, steps);
                        in_pool(|| run.learner.light_step(&example, global, own, rate, run.config)).map(Ok)
                    },
                )
            }
            Phase::Joint(joint) => {
                self.learner.freeze_statistics(true);
                let prepare = self.prepare_joint(joint);
                let joint = joint.clone();
                self.steps(
                    &phase,
                    prepare,
                    |_| [0; 2],
                    stop,
                    move |run, mut examples, rate| run.joint_step(&joint, examples.swap_remove(0), rate),
                )
            }
        }?;
        if outcome == Outcome::Done {
            self.validate()?;
            self.state.phase += 1;
            self.state.step = 0;
            // Other phases begin with that.
            if self.state.phase == self.phases.len() {
                self.save()?;
            }
        }
        Ok(outcome)
    }

    /// Makes steps until the phase is done, each of examples of one size.
    fn steps<T: Send + 'static>(
        &mut self,
        phase: &Phase,
        prepare: impl FnMut(&Sample, u64) -> Result<T, String> + Send + 'static,
        size: fn(&T) -> [usize; 2],
        stop: &dyn Fn() -> bool,
        mut step: impl FnMut(&mut Self, Vec<T>, f64) -> Result<Result<Progress, String>, Fault>,
    ) -> Result<Outcome, TrainError> {
        let RunState { seed, position, ref waiting, .. } = self.state;
        let feed = Feed::start(self.dataset.clone(), &self.config.data, seed, waiting.clone(), position, prepare);
        let mut batches = Batches::new(phase.batch_size());
        let mut feed = feed.map_err(TrainError::io(self.folder))?;
        let (mut unusable, mut waited) = (0, Duration::ZERO);
        while self.state.step < phase.steps() {
            if stop() {
                drop(feed);
                self.save()?;
                return Ok(Outcome::Stopped);
            }
            let examples = loop {
                let fed = feed.next().map_err(|_| TrainError::Empty)?;
                self.state.position = fed.next;
                match fed.example {
                    Ok(example) => {
                        if let Some(batch) = batches.add(fed.at, size(&example), example) {
                            break batch;
                        }
                    }
                    Err(reason) => self.pass_over(reason, &mut unusable)?,
                }
            };
            self.state.waiting = batches.waiting();
            waited += feed.take_waited();
            let rate = phase.rate(self.state.step);
            match step(self, examples, rate) {
                Ok(Ok(progress)) => {
                    unusable = 0;
                    self.done(&progress, rate, &mut waited)?;
                }
                Ok(Err(reason)) => self.pass_over(reason, &mut unusable)?,
                Err(fault) => self.go_back(&fault)?,
            }
        }
        Ok(Outcome::Done)
    }

    /// Counts a sample that cannot be used.
    fn pass_over(&mut self, reason: String, unusable: &mut u64) -> Result<(), TrainError> {
        *unusable += 1;
        if *unusable == MOST_UNUSABLE {
            return Err(TrainError::NoSamples { count: *unusable, last: reason });
        }
        (self.messages)(Message::Note(format!("passed over: {reason}")));
        Ok(())
    }

    /// Counts a step, tells of it, and does what is due after it.
    fn done(&mut self, progress: &Progress, rate: f64, waited: &mut Duration) -> Result<(), TrainError> {
        self.state.step += 1;
        self.state.total_steps += 1;
        self.log.add(progress);
        let losses = self.log.losses(progress);
        (self.messages)(Message::Step { done: self.state.step, losses });
        let (name, phase) = &self.phases[self.state.phase];
        let last = self.state.step == phase.steps();
        if last || self.state.step.is_multiple_of(self.config.log_steps) {
            let means = self.log.means(name, self.state.step, self.state.total_steps, rate, std::mem::take(waited));
            means.map_err(TrainError::io(&self.folder.join(LOG_FILE)))?;
        }
        if !last && self.state.step.is_multiple_of(self.config.validation.every_steps) {
            self.validate()?;
        }
        if self.saved.elapsed().as_secs_f64() > 60.0 * self.config.checkpoint_minutes {
            match self.learner.check() {
                Ok(()) => self.save()?,
                Err(fault) => self.go_back(&fault)?,
            }
        }
        Ok(())
    }

    fn prepare_light(
        &self,
        phase: &LightPhase,
    ) -> impl FnMut(&Sample, u64) -> Result<(LightExample, Vec<f32>), String> + Send + 'static {
        let (seed, augmentation) = (self.state.seed, self.config.augmentation.clone());
        let (network, phase) = (self.learner.network.clone(), phase.clone());
        let rays = RayCounts { novel: phase.novel_rays, visible: phase.visible_rays };
        // The depth network does not change in this stage.
        let depth_net = self.learner.depth.average.clone();
        let mut features = std::collections::HashMap::<(u64, u64), Vec<f32>>::new();
        move |sample, epoch| {
            let (variation, variant) = augmentation.of(seed, sample, epoch);
            let mut stream = Variation::stream(seed, "light example", sample, epoch);
            let shares = [phase.predicted_share, phase.sensor_share];
            let [predicted, sensor] = shares.map(|share| stream.random::<f32>() < share);
            let photo = || looked_at(&variation.photo(&sample.photo));
            let output = predicted.then(|| depth_net.forward(&[&photo()]));
            let predicted_m = output.as_ref().map(|output| output.depth_m(&variation.camera(&sample.camera)));
            let depth = match &predicted_m {
                Some(predicted_m) => KnownDepth::Predicted(predicted_m),
                None if sensor => KnownDepth::Sensor,
                None => KnownDepth::True,
            };
            let example = LightExample::new(sample, &variation, depth, &network, rays, &mut stream);
            let example = example.map_err(|error| error.to_string())?;
            let values = |global: Tensor<2>| global.into_data().iter().collect::<Vec<f32>>();
            let feature = || values(depth_net.global_feature(&photo()));
            let global = match output {
                Some(output) => values(output.global),
                None if augmentation.variants == 0 => feature(),
                None => features.entry((random::hash(sample.id.as_bytes()), variant)).or_insert_with(feature).clone(),
            };
            Ok((example, global))
        }
    }

    fn prepare_joint(
        &self,
        phase: &JointPhase,
    ) -> impl FnMut(&Sample, u64) -> Result<JointExample, String> + Send + 'static {
        let (seed, augmentation) = (self.state.seed, self.config.augmentation.clone());
        let (network, phase) = (self.learner.network.clone(), phase.clone());
        move |sample, epoch| {
            let variation = augmentation.of(seed, sample, epoch).0;
            let depth = DepthExample::new(sample, &variation, LONGER_SIDE).map_err(|e| e.to_string())?;
            let mut stream = Variation::stream(seed, "light example", sample, epoch);
            let (predicted, sensor) = (stream.random::<f32>(), stream.random::<f32>());
            let light = if predicted < phase.predicted_share {
                None
            } else {
                let known = if sensor < phase.sensor_share { KnownDepth::Sensor } else { KnownDepth::True };
                let rays = RayCounts { novel: phase.novel_rays, visible: phase.visible_rays };
                let example = LightExample::new(sample, &variation, known, &network, rays, &mut stream);
                Some(example.map_err(|error| error.to_string())?)
            };
            let sample = Sample { radiance: None, normal: None, albedo: None, ..sample.clone() };
            Ok(JointExample { sample, variation, epoch, depth, light })
        }
    }

    fn joint_step(
        &mut self,
        phase: &JointPhase,
        example: JointExample,
        rate: f64,
    ) -> Result<Result<Progress, String>, Fault> {
        let own = self.grows_itself(phase.own_growth, phase.steps);
        let seed = self.state.seed;
        let bf16 = self.config.bf16;
        in_pool(|| {
            let JointExample { sample, variation, epoch, depth, light } = example;
            let output = in_bf16(bf16, || self.learner.depth.net.forward(&[&depth.photo]));
            let light = match light {
                Some(light) => light,
                None => {
                    let predicted_m = output.depth_m(&depth.camera);
                    if !predicted_m.pixels().iter().all(|z| z.is_finite()) {
                        return Err(Fault("depth_net's depth is not finite".into()));
                    }
                    let rays = RayCounts { novel: phase.novel_rays, visible: phase.visible_rays };
                    let known = KnownDepth::Predicted(&predicted_m);
                    let mut stream = Variation::stream(seed, "predicted example", &sample, epoch);
                    let network = &self.learner.network;
                    match LightExample::new(&sample, &variation, known, network, rays, &mut stream) {
                        Ok(example) => example,
                        Err(error) => return Ok(Err(format!("{}: {error}", sample.id))),
                    }
                }
            };
            in_bf16(bf16, || self.learner.joint_step(output, &depth, &light, own, rate, self.config)).map(Ok)
        })
    }

    /// Whether this step's octree grows by the network's own predictions.
    fn grows_itself(&self, shares: [f32; 2], steps: u64) -> bool {
        let share = between(shares, self.state.step, steps);
        let index = self.state.total_steps ^ (self.state.setbacks << 48);
        random::stream(self.state.seed, "growth", index).random::<f32>() < share
    }

    /// Takes up the last checkpoint, but goes on with the data that come next.
    fn go_back(&mut self, fault: &Fault) -> Result<(), TrainError> {
        let (name, _) = &self.phases[self.state.phase];
        let (name, step, what) = (name.clone(), self.state.step, fault.0.clone());
        self.setbacks_here += 1;
        if self.setbacks_here > MOST_SETBACKS {
            return Err(TrainError::Diverged { phase: name, step, what, times: MOST_SETBACKS });
        }
        let (learner, state) = read(&self.folder.join(CHECKPOINT_FILE))?;
        let RunState { position, fingerprint, setbacks, ref mut waiting, .. } = self.state;
        let (waiting, setbacks) = (std::mem::take(waiting), setbacks + 1);
        self.learner = learner;
        self.state = RunState { position, waiting, setbacks, fingerprint, ..state };
        self.freeze_as_the_phase_wants();
        self.log.restart();
        let back_to = self.state.step;
        let line = json!({ "phase": name, "step": step, "fault": what, "back_to_step": back_to });
        self.log.line(&line).map_err(TrainError::io(&self.folder.join(LOG_FILE)))?;
        (self.messages)(Message::Note(format!("{name}, step {step}: {what}; back to step {back_to}, with other data")));
        Ok(())
    }

    fn freeze_as_the_phase_wants(&mut self) {
        match &self.phases[self.state.phase].1 {
            Phase::Depth(depth) => self.learner.freeze_statistics(depth.frozen_statistics),
            Phase::Joint(_) => self.learner.freeze_statistics(true),
            Phase::Light(_) => {}
        }
    }

    fn validate(&mut self) -> Result<(), TrainError> {
        let (name, phase) = &self.phases[self.state.phase];
        let lit = !matches!(phase, Phase::Depth(_));
        let name = name.clone();
        let settings = &self.config.validation;
        if settings.photos == 0 {
            return Ok(());
        }
        let (dataset, messages) = (&self.dataset, &mut self.messages);
        let validation = self.validation.get_or_insert_with(|| {
            Validation::new(&**dataset, settings.photos, settings.sheet_rows, |reason| {
                messages(Message::Note(format!("held-out sample passed over: {reason}")));
            })
        });
        let begun = Instant::now();
        let (report, sheet) = validation.run(&self.learner, lit);
        let seconds = (begun.elapsed().as_secs_f64() * 10.0).round() / 10.0;
        let line = json!({ "phase": name, "step": self.state.step, "total_steps": self.state.total_steps,
            "validation": report, "seconds": seconds });
        self.log.line(&line).map_err(TrainError::io(&self.folder.join(LOG_FILE)))?;
        if let Some(sheet) = sheet {
            let rgba = sheet.map(|&[r, g, b]| [r, g, b, 255]);
            write_rgba8(self.folder.join(SHEET_FILE), &rgba)?;
        }
        (self.messages)(Message::Validation(report));
        Ok(())
    }

    /// Writes the checkpoint and the weights for use, each whole or not at all.
    fn save(&mut self) -> Result<(), TrainError> {
        let begun = Instant::now();
        let path = self.folder.join(CHECKPOINT_FILE);
        let mut checkpoint = Checkpoint::default();
        self.state.learner = Some(self.learner.add_to(&mut checkpoint));
        self.state.log_bytes = self.log.bytes();
        checkpoint.state[STATE] = json!(self.state);
        checkpoint.write(&path, Precision::Full)?;
        self.learner.averages().write(self.folder.join(WEIGHTS_FILE), Precision::Half)?;
        self.setbacks_here = 0;
        self.saved = Instant::now();
        (self.messages)(Message::Saved { path, took: begun.elapsed() });
        Ok(())
    }
}

impl RunState {
    fn new(seed: u64, fingerprint: u64) -> Self {
        Self {
            seed,
            phase: 0,
            step: 0,
            total_steps: 0,
            setbacks: 0,
            position: LoaderState::default(),
            waiting: Vec::new(),
            fingerprint,
            log_bytes: 0,
            learner: None,
        }
    }
}

/// Reads a run's checkpoint.
fn read(path: &Path) -> Result<(Learner, RunState), TrainError> {
    let not = |reason: String| TrainError::NotThisRun { path: PathBuf::from(path), reason };
    let checkpoint = Checkpoint::read(path)?;
    let state: RunState = serde_json::from_value(checkpoint.state[STATE].clone())
        .map_err(|error| not(format!("its state is none of a run: {error}")))?;
    let learner = state.learner.clone().ok_or_else(|| not("its state has no networks".into()))?;
    Ok((Learner::from_checkpoint(checkpoint, &learner)?, state))
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use std::cell::Cell;

    use dataset::GeneratorConfig;
    use nets::light::LightNetConfig;
    use synth::SynthConfig;

    use super::*;
    use crate::{DataConfig, ValidationConfig};

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
            light: vec![LightPhase { steps: 3, octree_depth: 4, ..LightPhase::default() }],
            joint: Vec::new(),
            ..TrainConfig::default()
        };
        let folder = tempfile::tempdir().unwrap();
        let request = Request { folder: folder.path(), resume: false, seed: 1, weights: None, encoder_weights: None };
        let (steps, mut notes) = (Cell::new(0), Vec::new());
        let mut hear = |message| match message {
            Message::Step { .. } => steps.set(steps.get() + 1),
            Message::Note(note) => notes.push(note),
            _ => {}
        };
        let mut run = Run::new(&config, &request, config.phases(), &mut hear).unwrap();
        assert_eq!(run.phase(&|| steps.get() == 1).unwrap(), Outcome::Stopped);

        let mut poisoned = Checkpoint::default();
        poisoned.add_module("light", &run.learner.light.net);
        poisoned.insert("light.global.weights", &[8, 8], vec![f32::NAN; 64]);
        run.learner.light.net = poisoned.load_module("light", run.learner.light.net.clone()).unwrap();
        assert_eq!(run.learner.check(), Err(Fault("light_net.global.weights is not finite".into())));

        assert_eq!(run.phase(&|| false).unwrap(), Outcome::Done);
        assert_eq!((run.state.setbacks, run.state.total_steps), (1, 3));
        assert_eq!(run.learner.check(), Ok(()));
        drop(run);
        assert_eq!((steps.get(), notes.len()), (3, 1), "{notes:?}");
        assert!(notes[0].starts_with("light, step 1: ") && notes[0].contains("light_net."), "{}", notes[0]);
        assert!(notes[0].ends_with("back to step 1, with other data"), "{}", notes[0]);
        let log = std::fs::read_to_string(folder.path().join(LOG_FILE)).unwrap();
        assert!(log.contains("\"back_to_step\":1"), "{log}");
    }
}
