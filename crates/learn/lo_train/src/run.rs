//! A run: phase by phase, step by step, resumable at any.

use std::ops::ControlFlow;
use std::path::Path;
use std::sync::Arc;
use std::time::{Duration, Instant};

use lo_dataset::{
    ConcatDataset, CropModel, Dataset, DatasetLayout, Frames, GeneratedDataset, Generator, LoaderState, Sample,
    fingerprint,
};
use lo_events::{Cancelled, Event, OnEvent, Stage, TrainingPhase, Warning};
use lo_imaging::write_rgba8;
use lo_nets::checkpoint::Precision;
use lo_nets::conv::{in_bf16, in_pool};
use lo_nets::depth::panorama_image;
use lo_random::RngExt;
use serde_json::json;

use crate::augmentation::Variation;
use crate::config::{FramesData, PanoramaData, TrainConfig};
use crate::encoder_weights::{EncoderOrigin, read_encoder};
use crate::error::{ConfigError, Fault, TrainError};
use crate::example::{DepthExample, ExpectedExample, KnownDepth, LightExample, RayCounts, Unusable};
use crate::feed::{Batches, Feed, PassedOver};
use crate::learner::{Learner, Progress};
use crate::log::Log;
use crate::phases::{ExpectedPhase, LightPhase, Phase, between};
use crate::prepare::{JointExample, depth_examples, expected_examples, joint_examples, light_examples};
use crate::repeated::Repeated;
use crate::state::RunState;
use crate::validation::Validation;

/// Everything that is needed to go on.
pub const CHECKPOINT_FILE: &str = "checkpoint.safetensors";
/// The averaged weights in 16 bits, for use.
pub const WEIGHTS_FILE: &str = "weights.safetensors";
/// One line of JSON for every few steps, validation and incident.
pub const LOG_FILE: &str = "log.jsonl";
/// The last validation's pictures.
pub const SHEET_FILE: &str = "sheet.png";

/// What the contact sheet names as its writer.
const GENERATOR: &str = "lightoctree train";

/// Samples in a row that cannot be used before the run gives up.
const MAX_UNUSABLE: u64 = 1000;

/// Times that a run goes back to the same checkpoint before it gives up.
const MAX_SETBACKS: u32 = 5;

/// What a run is asked for beside its configuration.
#[derive(Clone, Copy, Debug)]
pub struct Request<'a> {
    /// Folder of the run's files; it exists.
    pub folder: &'a Path,
    /// Go on from the folder's checkpoint.
    pub resume: bool,
    /// Seed of all chance; a resumed run keeps its own.
    pub seed: u64,
    /// What it begins with; a resumed run has its own weights.
    pub start: Start<'a>,
}

/// Weights that a run begins with; what they do not give is random.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Start<'a> {
    /// None.
    Random,
    /// Published weights of the configuration's encoder, as [`read_encoder`] takes them.
    Encoder(&'a Path),
    /// The depth network of trained weights, with its global lighting decoder.
    DepthNetwork(&'a Path),
    /// Trained weights of all networks.
    Networks(&'a Path),
}

/// Trains until all phases are done, or until `on_event` ends the run after a step: then it is written as it stands, and can be resumed.
///
/// A resumed run goes on as if it had not been interrupted: the same weights to the bit, for every number of threads. The configuration may
/// have changed meanwhile, but not the networks' shapes, nor the phases that are done.
///
/// # Errors
/// See [`TrainError`].
pub fn train(config: &TrainConfig, request: &Request, on_event: OnEvent) -> Result<(), TrainError> {
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

/// What is learned from.
struct Sources {
    /// Everything.
    all: Arc<dyn Dataset>,
    /// Rooms whose light is known: of these, one of ten validates.
    rooms: Arc<dyn Dataset>,
    /// Photos of panoramas: of these, too.
    panoramas: Arc<dyn Dataset>,
}

fn open(config: &TrainConfig, seed: u64) -> Result<Sources, TrainError> {
    let data = &config.data;
    let rooms: Arc<dyn Dataset> = match &data.folder {
        Some(folder) => DatasetLayout::detect(folder)?.open(folder, CropModel { seed, ..CropModel::default() })?.into(),
        // Panoramas or frames alone are enough.
        None if !data.panoramas.is_empty() || !data.frames.is_empty() => Arc::new(ConcatDataset::new(Vec::new())),
        None => {
            let generator = Generator::new(seed, data.generator.clone())
                .map_err(|error| ConfigError::Generator(error.to_string()))?;
            Arc::new(GeneratedDataset::new(generator, data.generated_rooms))
        }
    };
    let panoramas = open_panoramas(&data.panoramas, seed)?;
    let frames = data.frames.iter().map(|FramesData { list, repeats }| {
        Ok(Arc::new(Repeated::new(Frames::open(list)?, *repeats as usize)) as Arc<dyn Dataset>)
    });
    let frames: Vec<_> = frames.collect::<Result<_, TrainError>>()?;
    // Photos of a generated room are made together: a block that joined parts do not have.
    let all = if panoramas.is_empty() && frames.is_empty() {
        rooms.clone()
    } else {
        Arc::new(ConcatDataset::new([rooms.clone(), panoramas.clone()].into_iter().chain(frames).collect()))
    };
    Ok(Sources { all, rooms, panoramas })
}

fn open_panoramas(panoramas: &[PanoramaData], seed: u64) -> Result<Arc<dyn Dataset>, TrainError> {
    let open = |PanoramaData { folder, plans, crop }: &PanoramaData| {
        let crop = CropModel { seed, ..*crop };
        Ok(Arc::from(DatasetLayout::Panoramas.open_with_plans(folder, crop, plans.as_deref())?))
    };
    Ok(Arc::new(ConcatDataset::new(panoramas.iter().map(open).collect::<Result<_, TrainError>>()?)))
}

struct Run<'a> {
    config: &'a TrainConfig,
    folder: &'a Path,
    sources: Sources,
    phases: Vec<(TrainingPhase, Phase)>,
    on_event: OnEvent<'a>,
    /// The handler asked the run to end.
    cancelled: bool,
    learner: Learner,
    state: RunState,
    log: Log,
    validation: Option<Validation>,
    saved: Instant,
    /// Setbacks since the checkpoint was written.
    setbacks_here: u32,
}

impl<'a> Run<'a> {
    fn new(
        config: &'a TrainConfig,
        request: &Request<'a>,
        phases: Vec<(TrainingPhase, Phase)>,
        on_event: OnEvent<'a>,
    ) -> Result<Self, TrainError> {
        let folder = request.folder;
        let resumed = request.resume.then(|| RunState::read(&folder.join(CHECKPOINT_FILE))).transpose()?;
        // Rooms that are generated on the fly depend on it too.
        let seed = resumed.as_ref().map_or(request.seed, |(_, state)| state.seed);
        let (sources, mut cancelled) = (open(config, seed)?, false);
        let fingerprint = fingerprint(&*sources.all);
        let (learner, state) = match resumed {
            Some((learner, state)) if state.fingerprint == fingerprint => (learner, state),
            Some((learner, state)) => {
                let position = LoaderState { epoch: state.position.epoch + 1, ..LoaderState::default() };
                let warning = Warning::DatasetChanged { epoch: position.epoch };
                cancelled = on_event(Event::Warning(warning)).is_break();
                (learner, RunState { position, waiting: Vec::new(), fingerprint, ..state })
            }
            None => {
                let first_depth = phases.iter().find_map(|(_, phase)| phase.octree_depth());
                let octree_depth = first_depth.unwrap_or(config.network.depth);
                let mut learner = Learner::new(config, octree_depth, seed).map_err(ConfigError::from)?;
                let mut state = RunState::new(seed, fingerprint);
                match request.start {
                    Start::Random => {}
                    Start::DepthNetwork(path) => learner.load_depth(path, config)?,
                    Start::Networks(path) => learner.load(path, config, seed)?,
                    Start::Encoder(path) => {
                        let (weights, origin) = read_encoder(path, config.encoder)?;
                        learner.load_encoder(&weights)?;
                        if !origin.is_published(config.encoder) {
                            let EncoderOrigin { file, sha256 } = origin.clone();
                            cancelled =
                                on_event(Event::Warning(Warning::UnpublishedEncoder { file, sha256 })).is_break();
                        }
                        state.encoder_origin = Some(origin);
                    }
                }
                (learner, state)
            }
        };
        let log_path = folder.join(LOG_FILE);
        let log = Log::open(&log_path, state.log_bytes).map_err(TrainError::io(&log_path))?;
        let (saved, setbacks_here) = (Instant::now(), 0);
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
            setbacks_here,
        })
    }

    /// The rest of the phase at hand.
    fn phase(&mut self) -> Result<(), TrainError> {
        let (name, phase) = self.phases[self.state.phase].clone();
        if self.state.step == 0 {
            if let Some(depth) = phase.octree_depth() {
                self.learner.deepen(self.config, depth, self.state.seed).map_err(ConfigError::from)?;
            }
            // Whatever happens, there is something to go back to.
            self.save()?;
        }
        let (stage, begun) = (Stage::Training(name), Instant::now());
        self.say(Event::Begun(stage.clone()));
        self.say(Event::Progress { stage: stage.clone(), done: self.state.step, total: phase.steps() });
        self.freeze_as_the_phase_wants();
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
                        let own = run.grows_itself(light);
                        in_pool(|| run.learner.light_step(&example, global, own, learning_rate, run.config)).map(Ok)
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
        self.say(Event::Done { stage, took: begun.elapsed() });
        self.state.phase += 1;
        self.state.step = 0;
        // Other phases begin with that.
        if self.state.phase == self.phases.len() {
            self.save()?;
        }
        Ok(())
    }

    /// Says what happens, and takes note of the answer.
    fn say(&mut self, event: Event) {
        if (self.on_event)(event) == ControlFlow::Break(()) {
            self.cancelled = true;
        }
    }

    /// Makes steps until the phase is done, each of examples of one size.
    fn steps<T: Send + 'static>(
        &mut self,
        phase: &Phase,
        prepare: impl FnMut(&Sample, u64) -> Result<T, Unusable> + Send + 'static,
        size: fn(&T) -> [usize; 2],
        mut step: impl FnMut(&mut Self, Vec<T>, f64) -> Result<Result<Progress, PassedOver>, Fault>,
    ) -> Result<(), TrainError> {
        let RunState { seed, position, ref waiting, .. } = self.state;
        let feed = Feed::start(self.sources.all.clone(), &self.config.data, seed, waiting.clone(), position, prepare);
        let mut batches = Batches::new(phase.batch_size());
        let mut feed = feed.map_err(TrainError::io(self.folder))?;
        let (mut unusable, mut waited) = (0, Duration::ZERO);
        while self.state.step < phase.steps() {
            if self.cancelled {
                drop(feed);
                self.save()?;
                return Err(Cancelled.into());
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
                    Err(passed_over) => self.pass_over(passed_over, &mut unusable)?,
                }
            };
            self.state.waiting = batches.waiting();
            waited += feed.take_waited();
            let learning_rate = phase.schedule().learning_rate_at(self.state.step);
            match step(self, examples, learning_rate) {
                Ok(Ok(progress)) => {
                    unusable = 0;
                    self.done(&progress, learning_rate, &mut waited)?;
                }
                Ok(Err(passed_over)) => self.pass_over(passed_over, &mut unusable)?,
                Err(fault) => self.go_back(fault)?,
            }
        }
        Ok(())
    }

    /// Counts a sample that cannot be used.
    fn pass_over(&mut self, passed_over: PassedOver, unusable: &mut u64) -> Result<(), TrainError> {
        let PassedOver { sample, error } = passed_over;
        *unusable += 1;
        if *unusable == MAX_UNUSABLE {
            return Err(TrainError::NoSamples { count: *unusable, last: format!("{sample}: {error}") });
        }
        self.say(Event::Warning(Warning::SamplePassedOver { sample, error }));
        Ok(())
    }

    /// Counts a step, tells of it, and does what is due after it.
    fn done(&mut self, progress: &Progress, learning_rate: f64, waited: &mut Duration) -> Result<(), TrainError> {
        self.state.step += 1;
        self.state.total_steps += 1;
        self.log.add(progress);
        let losses = self.log.losses(progress);
        let (name, total) = (self.phases[self.state.phase].0, self.phases[self.state.phase].1.steps());
        self.say(Event::Progress { stage: Stage::Training(name), done: self.state.step, total });
        self.say(Event::Figures { stage: Stage::Training(name), figures: losses });
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
                Err(fault) => self.go_back(fault)?,
            }
        }
        Ok(())
    }

    /// Makes the examples of a phase of expected light, then its steps. A resumed run makes the same examples again.
    fn expected_steps(&mut self, phase: &ExpectedPhase) -> Result<(), TrainError> {
        let Some(examples) = self.expected_examples(phase)? else {
            self.save()?;
            return Err(Cancelled.into());
        };
        while self.state.step < phase.schedule.steps {
            if self.cancelled {
                self.save()?;
                return Err(Cancelled.into());
            }
            let mut stream = lo_random::stream(self.state.seed, "expected light", self.state.total_steps);
            let drawn: Vec<&ExpectedExample> =
                (0..phase.batch_size).map(|_| &examples[stream.random_range(0..examples.len())]).collect();
            let learning_rate = phase.schedule.learning_rate_at(self.state.step);
            let (learner, config) = (&mut self.learner, self.config);
            match in_pool(|| learner.expected_step(&drawn, &mut stream, learning_rate, config)) {
                Ok(progress) => self.done(&progress, learning_rate, &mut Duration::default())?,
                Err(fault) => self.go_back(fault)?,
            }
        }
        Ok(())
    }

    /// The photos that a phase of expected light learns from; `None` where the run is cancelled.
    fn expected_examples(&mut self, phase: &ExpectedPhase) -> Result<Option<Vec<ExpectedExample>>, TrainError> {
        let Sources { all, panoramas, .. } = &self.sources;
        let own = open_panoramas(&phase.panoramas, self.state.seed)?;
        let dataset = [&own, panoramas, all].into_iter().find(|data| !data.is_empty()).unwrap_or(all).clone();
        let prepare = expected_examples(&phase.augmentation, &self.learner, self.state.seed);
        let feed =
            Feed::start(dataset, &self.config.data, self.state.seed, Vec::new(), LoaderState::default(), prepare);
        let mut feed = feed.map_err(TrainError::io(self.folder))?;
        let (mut examples, mut unusable, begun) = (Vec::with_capacity(phase.photos), 0, Instant::now());
        self.say(Event::Begun(Stage::ReadSamples));
        while examples.len() < phase.photos {
            if self.cancelled {
                return Ok(None);
            }
            match feed.next().map_err(|_| TrainError::Empty)?.example {
                Ok(example) => {
                    unusable = 0;
                    examples.push(example);
                }
                Err(passed_over) => self.pass_over(passed_over, &mut unusable)?,
            }
            let done = examples.len() as u64;
            self.say(Event::Progress { stage: Stage::ReadSamples, done, total: phase.photos as u64 });
        }
        self.say(Event::Done { stage: Stage::ReadSamples, took: begun.elapsed() });
        Ok(Some(examples))
    }

    fn joint_step(
        &mut self,
        phase: &LightPhase,
        example: JointExample,
        learning_rate: f64,
    ) -> Result<Result<Progress, PassedOver>, Fault> {
        let own = self.grows_itself(phase);
        let seed = self.state.seed;
        let bf16 = self.config.bf16;
        in_pool(|| {
            let JointExample { sample, variation, epoch, depth, light } = example;
            let output = in_bf16(bf16, || self.learner.depth.net.forward(&[&depth.photo]));
            let mut light = match light {
                Some(light) => light,
                None => {
                    let predicted_m = output.depth_m(&depth.camera);
                    if !predicted_m.pixels().iter().all(|z| z.is_finite()) {
                        return Err(Fault::Depth);
                    }
                    let rays = RayCounts { novel: phase.novel_rays, visible: phase.visible_rays };
                    let known = KnownDepth::Predicted(&predicted_m);
                    let mut stream = Variation::stream(seed, "predicted example", &sample, epoch);
                    let network = &self.learner.network;
                    match LightExample::new(&sample, &variation, known, network, rays, &mut stream) {
                        Ok(example) => example,
                        Err(error) => return Ok(Err(PassedOver { sample: sample.id, error: error.to_string() })),
                    }
                }
            };
            // As it is now: no gradient goes through it.
            let map = panorama_image(self.learner.depth.net.panorama.forward(output.global.clone()));
            light.input = self.learner.network.told(light.input, light.up, map);
            in_bf16(bf16, || self.learner.joint_step(output, &depth, &light, own, learning_rate, self.config)).map(Ok)
        })
    }

    /// Whether this step's octree grows by the network's own predictions.
    fn grows_itself(&self, phase: &LightPhase) -> bool {
        let share = between(phase.scheduled_sampling, self.state.step, phase.schedule.steps);
        let index = self.state.total_steps ^ (self.state.setbacks << 48);
        lo_random::stream(self.state.seed, "growth", index).random::<f32>() < share
    }

    /// Takes up the last checkpoint, but goes on with the data that come next.
    fn go_back(&mut self, fault: Fault) -> Result<(), TrainError> {
        let (phase, step) = (self.phases[self.state.phase].0, self.state.step);
        self.setbacks_here += 1;
        if self.setbacks_here > MAX_SETBACKS {
            return Err(TrainError::Diverged { phase, step, fault, times: MAX_SETBACKS });
        }
        let (learner, state) = RunState::read(&self.folder.join(CHECKPOINT_FILE))?;
        let RunState { position, fingerprint, setbacks, ref mut waiting, .. } = self.state;
        let (waiting, setbacks) = (std::mem::take(waiting), setbacks + 1);
        self.learner = learner;
        self.state = RunState { position, waiting, setbacks, fingerprint, ..state };
        self.freeze_as_the_phase_wants();
        self.log.restart();
        let (fault, back_to_step) = (fault.to_string(), self.state.step);
        let line = json!({ "phase": phase.to_string(), "step": step, "fault": fault, "back_to_step": back_to_step });
        self.log.line(&line).map_err(TrainError::io(&self.folder.join(LOG_FILE)))?;
        self.say(Event::Warning(Warning::SetBack { phase, step, fault, back_to_step }));
        Ok(())
    }

    fn freeze_as_the_phase_wants(&mut self) {
        match &self.phases[self.state.phase].1 {
            Phase::Depth(depth) => self.learner.freeze_statistics(depth.frozen_statistics),
            Phase::Joint(_) => self.learner.freeze_statistics(true),
            Phase::Light(_) | Phase::Expected(_) => {}
        }
    }

    fn validate(&mut self) -> Result<(), TrainError> {
        let (name, lit) =
            (self.phases[self.state.phase].0, !matches!(self.phases[self.state.phase].1, Phase::Depth(_)));
        let settings = &self.config.validation;
        if settings.photos == 0 {
            return Ok(());
        }
        self.say(Event::Begun(Stage::Validation));
        let (sources, on_event, cancelled) = (&self.sources, &mut self.on_event, &mut self.cancelled);
        let validation = self.validation.get_or_insert_with(|| {
            Validation::new(&*sources.rooms, &*sources.panoramas, settings.photos, settings.sheet_rows, |warning| {
                *cancelled |= on_event(Event::Warning(warning)).is_break();
            })
        });
        let begun = Instant::now();
        let (report, sheet) = validation.run(&self.learner, lit);
        let took = begun.elapsed();
        let seconds = (took.as_secs_f64() * 10.0).round() / 10.0;
        let line = json!({ "phase": name.to_string(), "step": self.state.step, "total_steps": self.state.total_steps,
            "validation": report, "seconds": seconds });
        self.log.line(&line).map_err(TrainError::io(&self.folder.join(LOG_FILE)))?;
        if let Some(sheet) = sheet {
            let rgba = sheet.map(|&[r, g, b]| [r, g, b, 255]);
            write_rgba8(self.folder.join(SHEET_FILE), &rgba, GENERATOR)?;
        }
        self.say(Event::Figures { stage: Stage::Validation, figures: report.figures() });
        self.say(Event::Done { stage: Stage::Validation, took });
        Ok(())
    }

    /// Writes the checkpoint and the weights for use, each whole or not at all.
    fn save(&mut self) -> Result<(), TrainError> {
        let begun = Instant::now();
        self.say(Event::Begun(Stage::Checkpoint));
        self.state.log_bytes = self.log.bytes();
        self.state.write(&self.learner, &self.folder.join(CHECKPOINT_FILE))?;
        self.learner.averages().write(self.folder.join(WEIGHTS_FILE), Precision::Half)?;
        self.setbacks_here = 0;
        self.saved = Instant::now();
        self.say(Event::Done { stage: Stage::Checkpoint, took: begun.elapsed() });
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
    use crate::phases::Schedule;

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
                schedule: Schedule { steps: 3, ..LightPhase::USUAL.schedule },
                octree_depth: 4,
                ..LightPhase::USUAL
            }],
            joint: Vec::new(),
            ..TrainConfig::default()
        };
        let folder = tempfile::tempdir().unwrap();
        let request = Request { folder: folder.path(), resume: false, seed: 1, start: Start::Random };
        let (mut steps, mut warnings) = (0, Vec::new());
        let mut hear = |event| {
            match event {
                Event::Figures { stage: Stage::Training(_), .. } => {
                    steps += 1;
                    if steps == 1 {
                        return ControlFlow::Break(());
                    }
                }
                Event::Warning(warning) => warnings.push(warning),
                _ => {}
            }
            ControlFlow::Continue(())
        };
        let mut run = Run::new(&config, &request, config.phases(), &mut hear).unwrap();
        assert!(matches!(run.phase(), Err(TrainError::Cancelled(_))));
        run.cancelled = false;

        let mut poisoned = Checkpoint::default();
        poisoned.add_module("light", &run.learner.light.net);
        poisoned.insert("light.global.weights", &[8, 8], vec![f32::NAN; 64]);
        run.learner.light.net = poisoned.load_module("light", run.learner.light.net.clone()).unwrap();
        let fault = run.learner.check().unwrap_err();
        assert_eq!(fault.to_string(), "light_net.global.weights is not finite");

        run.phase().unwrap();
        assert_eq!((run.state.setbacks, run.state.total_steps), (1, 3));
        assert!(run.learner.check().is_ok());
        drop(run);
        assert_eq!(steps, 3);
        let [Warning::SetBack { phase, step: 1, fault, back_to_step: 1 }] = &warnings[..] else {
            panic!("{warnings:?}");
        };
        assert_eq!(phase.to_string(), "light");
        assert!(fault.contains("light_net."), "{fault}");
        let log = std::fs::read_to_string(folder.path().join(LOG_FILE)).unwrap();
        assert!(log.contains("\"back_to_step\":1"), "{log}");
    }
}
