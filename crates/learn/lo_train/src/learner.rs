//! The networks while they learn: weights, optimisers, averages, and one step of each stage.

use std::path::Path;

use burn::module::Module;
use burn::tensor::{Device, Tensor, TensorData};
use lo_cone::Settings;
use lo_nets::checkpoint::{Checkpoint, CheckpointError};
use lo_nets::depth::{DepthNet, DepthNetConfig, DepthOutput, PatchGan, depth_losses, panorama_loss, perspective_loss};
use lo_nets::expected::{ExpectedLightNet, expected_losses};
use lo_nets::light::{Growth, LightConfigError, LightLosses, LightNet, LightNetConfig};
use lo_nets::{Adam, EXPECTED_NET, Networks};
use lo_random::Stream;
use serde::{Deserialize, Serialize};

use crate::config::TrainConfig;
use crate::deepen::deepened;
use crate::error::{ConfigError, Fault, TrainError};
use crate::example::{DepthExample, ExpectedExample, LightExample, PANORAMA};
use crate::phases::DepthPhase;
use crate::trained::Trained;
use crate::weights::gradient_norm;

/// Names in a checkpoint. The averages are under those that [`Networks`] has, so that a checkpoint also is a file of weights.
const DEPTH: &str = "training.depth_net";
const LIGHT: &str = "training.light_net";
const EXPECTED: &str = "training.expected_light";
const DISCRIMINATOR: &str = "training.discriminator";

/// The parts of a loss and what came of them.
#[derive(Debug, Default)]
pub(crate) struct Progress {
    /// Name and value, not weighted.
    pub losses: Vec<(&'static str, f32)>,
    /// Norms of the gradients before they were shortened.
    pub norms: Vec<(&'static str, f32)>,
}

/// All networks of a run.
#[derive(Debug)]
pub(crate) struct Learner {
    pub depth: Trained<DepthNet>,
    pub light: Trained<LightNet>,
    pub expected: Trained<ExpectedLightNet>,
    /// Shape of the light network as it is now.
    pub network: LightNetConfig,
    discriminator: PatchGan,
    discriminator_adam: Adam,
}

/// Which networks they are, and the steps of the averages since they began.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(crate) struct LearnerState {
    #[serde(flatten)]
    depth: DepthNetConfig,
    network: LightNetConfig,
    averaged: [u64; 2],
    /// The same of the network of expected light.
    #[serde(default)]
    averaged_expected: u64,
}

/// Where gradients are recorded.
fn recording() -> Device {
    Device::flex().autodiff()
}

fn untrained_expected(seed: u64) -> Trained<ExpectedLightNet> {
    let [net, average] = [recording(), Device::flex()].map(|device| ExpectedLightNet::new(seed, &device));
    Trained { net, average, adam: Adam::default(), steps: 0 }
}

fn scalar(loss: &Tensor<1>) -> f32 {
    loss.clone().inner().into_scalar::<f32>()
}

impl Learner {
    /// Untrained networks, the light network for this octree depth.
    ///
    /// # Errors
    /// A configuration out of range.
    pub fn new(config: &TrainConfig, octree_depth: u32, seed: u64) -> Result<Self, LightConfigError> {
        let network = config.network_of(octree_depth);
        let features = network.global_features;
        let plain = || Device::flex();
        let mut discriminator_adam = Adam::default();
        // As Isola et al. 2017.
        discriminator_adam.beta1 = 0.5;
        Ok(Self {
            depth: Trained {
                net: DepthNet::new(config.encoder, features, seed, &recording()).with_longer_side(config.longer_side),
                average: DepthNet::new(config.encoder, features, seed, &plain()).with_longer_side(config.longer_side),
                adam: Adam::default(),
                steps: 0,
            },
            light: Trained {
                net: LightNet::new(&network, seed, &recording())?,
                average: LightNet::new(&network, seed, &plain())?,
                adam: Adam::default(),
                steps: 0,
            },
            expected: untrained_expected(seed),
            network,
            discriminator: PatchGan::new(seed, &recording()),
            discriminator_adam,
        })
    }

    /// Starts the depth network's encoder with published weights.
    ///
    /// # Errors
    /// Names what is missing or of another shape.
    pub fn load_encoder(&mut self, weights: &Checkpoint) -> Result<(), CheckpointError> {
        self.depth.net.encoder = self.depth.net.encoder.clone().load_published(weights)?;
        self.depth.average.encoder = self.depth.average.encoder.clone().load_published(weights)?;
        Ok(())
    }

    /// Starts with the networks of a file of weights, the light network made one for octrees of the depth at hand.
    ///
    /// # Errors
    /// Of the file; networks of another shape than the configuration's.
    pub fn load(&mut self, path: &Path, config: &TrainConfig, seed: u64) -> Result<(), TrainError> {
        // Twice: clones share running statistics.
        let (start, average) = (Networks::read(path)?, Networks::read(path)?);
        let own = &start.config;
        let wanted = config.network_of(own.depth);
        if *own != wanted {
            return Err(not_this_run(
                path,
                "its networks are of another shape than [network] of the configuration says",
            ));
        }
        self.take_depth(path, [start.depth, average.depth], config)?;
        if let (Some(net), Some(average)) = (start.expected, average.expected) {
            self.expected = Trained { net: net.train(), average, adam: Adam::default(), steps: 1 };
        }
        let light = |old: &LightNet, device: &Device| {
            deepened(old, own, &self.network, seed, device).map_err(ConfigError::from)
        };
        (self.light.net, self.light.average) =
            (light(&start.light, &recording())?, light(&average.light, &Device::flex())?);
        Ok(())
    }

    /// Starts with the depth network of a file of weights, and with a light network as it was drawn.
    ///
    /// # Errors
    /// Of the file; another encoder or other global features than the configuration's.
    pub fn load_depth(&mut self, path: &Path, config: &TrainConfig) -> Result<(), TrainError> {
        // Twice: clones share running statistics.
        let (start, average) = (Networks::read(path)?, Networks::read(path)?);
        if start.config.global_features != config.network.global_features {
            return Err(not_this_run(
                path,
                "its global features are not as many as [network] of the configuration says",
            ));
        }
        self.take_depth(path, [start.depth, average.depth], config)
    }

    /// A depth network of the file at `path`, to go on with and as the average.
    fn take_depth(&mut self, path: &Path, read: [DepthNet; 2], config: &TrainConfig) -> Result<(), TrainError> {
        let [net, mut average] = read;
        let encoder = net.encoder_kind();
        if encoder != config.encoder {
            return Err(not_this_run(
                path,
                &format!("its encoder is {encoder}, that of the configuration {}", config.encoder),
            ));
        }
        let mut net = net.train();
        // What weights of before have not learned begins as it was drawn.
        let own = [self.depth.net.perspective.take(), self.depth.average.perspective.take()];
        for (head, own) in [&mut net.perspective, &mut average.perspective].into_iter().zip(own) {
            match (head.as_mut(), own) {
                (Some(head), Some(own)) if head.lens.is_none() => head.lens = own.lens,
                (None, own) => *head = own,
                _ => {}
            }
        }
        let side = config.longer_side;
        (self.depth.net, self.depth.average) = (net.with_longer_side(side), average.with_longer_side(side));
        Ok(())
    }

    /// The averaged weights: what is used.
    pub fn averages(&self) -> Networks {
        Networks {
            depth: self.depth.average.clone(),
            light: self.light.average.clone(),
            expected: (self.expected.steps > 0).then(|| self.expected.average.clone()),
            config: self.network.clone(),
        }
    }

    /// The averaged weights as a file of them gives them back, in 16 bits: what is validated.
    pub fn exported(&self) -> Networks {
        let mut checkpoint = Checkpoint::default();
        self.averages().add_to(&mut checkpoint);
        checkpoint.round_to_half();
        Networks::from_checkpoint(checkpoint, &Device::flex()).expect("networks are what they were made of")
    }

    /// Adds everything to a checkpoint but what [`LearnerState`] holds, which it gives.
    pub fn add_to(&self, checkpoint: &mut Checkpoint) -> LearnerState {
        self.averages().add_to(checkpoint);
        checkpoint.add_module(DEPTH, &self.depth.net);
        checkpoint.add_module(LIGHT, &self.light.net);
        checkpoint.add_module(EXPECTED, &self.expected.net);
        checkpoint.add_module(DISCRIMINATOR, &self.discriminator);
        for (name, adam) in [
            (DEPTH, &self.depth.adam),
            (LIGHT, &self.light.adam),
            (EXPECTED, &self.expected.adam),
            (DISCRIMINATOR, &self.discriminator_adam),
        ] {
            checkpoint.add_adam(&adam_name(name), adam);
        }
        LearnerState {
            depth: self.depth.net.config(),
            network: self.network.clone(),
            averaged: [self.depth.steps, self.light.steps],
            averaged_expected: self.expected.steps,
        }
    }

    /// What [`Learner::add_to`] added.
    ///
    /// # Errors
    /// Names what is missing or of another shape.
    pub fn from_checkpoint(mut checkpoint: Checkpoint, state: &LearnerState) -> Result<Self, CheckpointError> {
        let wrong = |problem| CheckpointError::Weights { module: LIGHT.to_owned(), problems: vec![problem] };
        let LearnerState { depth, network, averaged: [depth_steps, light_steps], averaged_expected } = state;
        let adams = [DEPTH, LIGHT, DISCRIMINATOR].map(|name| checkpoint.load_adam(&adam_name(name)));
        let [depth_adam, light_adam, discriminator_adam] = adams;
        let blank = depth.blank(network.global_features, &Device::flex());
        let depth = checkpoint.take_module(DEPTH, blank)?.train();
        let blank = LightNet::new(network, 0, &Device::flex()).map_err(|error| wrong(error.to_string()))?;
        let light = checkpoint.take_module(LIGHT, blank)?.train();
        // Checkpoints of before it was trained hold none.
        let mut expected = untrained_expected(0);
        if checkpoint.values_of(EXPECTED) > 0 {
            let adam = checkpoint.load_adam(&adam_name(EXPECTED))?;
            let net = checkpoint.take_module(EXPECTED, ExpectedLightNet::new(0, &Device::flex()))?.train();
            expected = Trained { net, adam, ..expected };
        }
        let discriminator = checkpoint.take_module(DISCRIMINATOR, PatchGan::new(0, &Device::flex()))?.train();
        let averages = Networks::from_checkpoint(checkpoint, &Device::flex())?;
        if let Some(average) = averages.expected {
            expected = Trained { average, steps: *averaged_expected, ..expected };
        }
        Ok(Self {
            depth: Trained { net: depth, average: averages.depth, adam: depth_adam?, steps: *depth_steps },
            light: Trained { net: light, average: averages.light, adam: light_adam?, steps: *light_steps },
            expected,
            network: network.clone(),
            discriminator,
            discriminator_adam: discriminator_adam?,
        })
    }

    /// Makes the light network one for octrees of another depth: the stages that both have keep their weights, what is new is drawn
    /// from the seed, and the optimiser begins anew.
    ///
    /// # Errors
    /// A configuration out of range.
    pub fn deepen(&mut self, config: &TrainConfig, octree_depth: u32, seed: u64) -> Result<(), LightConfigError> {
        let network = config.network_of(octree_depth);
        if network == self.network {
            return Ok(());
        }
        let make = |old: &LightNet, device: &Device| deepened(old, &self.network, &network, seed, device);
        let (net, average) =
            (make(&self.light.net.valid(), &recording())?, make(&self.light.average, &Device::flex())?);
        self.light = Trained { net, average, adam: Adam::default(), steps: 0 };
        self.network = network;
        Ok(())
    }

    /// Whether the depth network's encoder normalises by its running statistics also while it learns.
    pub fn freeze_statistics(&mut self, frozen: bool) {
        self.depth.net.encoder.freeze_statistics(frozen);
    }

    /// Whether all weights are numbers.
    pub fn check(&self) -> Result<(), Fault> {
        self.depth.check("depth_net")?;
        self.light.check("light_net")?;
        self.expected.check(EXPECTED_NET)
    }

    /// A step of the depth network and its discriminator on photos of one size.
    pub fn depth_step(
        &mut self,
        examples: &[DepthExample],
        learning_rate: f64,
        phase: &DepthPhase,
        config: &TrainConfig,
    ) -> Result<Progress, Fault> {
        let share = |name: &str| if name.starts_with("encoder.") { phase.encoder_lr_ratio } else { 1.0 };
        let examples: Vec<_> = examples.iter().collect();
        let photos: Vec<_> = examples.iter().map(|example| &example.photo).collect();
        let (total, judged, mut progress) = if phase.decoder_only {
            let (total, losses) = self.decoder_losses(self.depth.net.forward_detached(&photos), &examples, config);
            (total, None, Progress { losses, norms: Vec::new() })
        } else {
            self.depth_losses(self.depth.net.forward(&photos), &examples, config)
        };
        let mut gradients = total.backward();
        let norm = self.depth.descend("depth_net", &mut gradients, learning_rate, &share, config);
        progress.norms.push(("depth", norm.map_err(|fault| with_losses(fault, &progress))?));
        drop(gradients);
        self.discriminator_step(judged, learning_rate * config.discriminator_lr_ratio, &mut progress)?;
        Ok(progress)
    }

    /// The weighted sum of the losses of depth and camera, and each.
    fn decoder_losses(
        &self,
        output: DepthOutput,
        examples: &[&DepthExample],
        config: &TrainConfig,
    ) -> (Tensor<1>, Vec<(&'static str, f32)>) {
        let weights = &config.depth_losses;
        let extents: Vec<_> = examples.iter().map(|example| example.extent_m()).collect();
        let [log_depth, absolute, variance] = depth_losses(output.log_extent, &extents.iter().collect::<Vec<_>>());
        let mut losses = vec![
            ("log_depth", scalar(&log_depth)),
            ("absolute", scalar(&absolute)),
            ("scale_invariant", scalar(&variance)),
        ];
        let mut total =
            log_depth * weights.log_depth + absolute * weights.absolute + variance * weights.scale_invariant;
        if let Some(field) = &output.perspective {
            let cameras: Vec<_> = examples.iter().map(|example| example.perspective).collect();
            let perspective = perspective_loss(field, &cameras);
            losses.push(("perspective", scalar(&perspective)));
            total = total + perspective * weights.perspective;
        }
        (total, losses)
    }

    /// The weighted sum of the depth network's losses, what the discriminator needs for its own step, and the losses.
    fn depth_losses(
        &self,
        output: DepthOutput,
        examples: &[&DepthExample],
        config: &TrainConfig,
    ) -> (Tensor<1>, Option<Judged>, Progress) {
        let weights = &config.depth_losses;
        let global = output.global.clone();
        let (mut total, mut losses) = self.decoder_losses(output, examples, config);
        let made = self.depth.net.panorama.forward(global);
        let truths: Vec<_> = examples.iter().map(|example| example.panorama.as_ref()).collect();
        let [panorama, panorama_tone, panorama_irradiance] = panorama_loss(made.clone(), &truths);
        losses.extend([
            ("panorama", scalar(&panorama)),
            ("panorama_tone", scalar(&panorama_tone)),
            ("panorama_irradiance", scalar(&panorama_irradiance)),
        ]);
        total = total
            + panorama * weights.panorama
            + panorama_tone * weights.panorama_tone
            + panorama_irradiance * weights.panorama_irradiance;
        let mut judged = None;
        let truths: Option<Vec<_>> = truths.into_iter().collect();
        if weights.adversarial > 0.0
            && let Some(truths) = truths
        {
            let shown: Vec<_> = examples.iter().map(|example| example.shown()).collect();
            let condition = channels::<4>(shown.iter().map(|shown| shown.pixels()));
            let real = channels::<3>(truths.iter().map(|truth| truth.pixels()));
            let opinion = self.discriminator.generator_loss(made.clone(), condition.clone());
            losses.push(("adversarial", scalar(&opinion)));
            total = total + opinion * weights.adversarial;
            judged = Some(Judged { real, made: made.detach(), condition });
        }
        (total, judged, Progress { losses, norms: Vec::new() })
    }

    fn discriminator_step(
        &mut self,
        judged: Option<Judged>,
        learning_rate: f64,
        progress: &mut Progress,
    ) -> Result<(), Fault> {
        let Some(Judged { real, made, condition }) = judged else { return Ok(()) };
        let loss = self.discriminator.discriminator_loss(real, made, condition);
        progress.losses.push(("discriminator", scalar(&loss)));
        let gradients = loss.backward();
        gradient_norm(&self.discriminator, &gradients)
            .map_err(|layer| Fault::Gradient { parameter: format!("discriminator.{layer}"), losses: Vec::new() })?;
        self.discriminator = self.discriminator_adam.step(self.discriminator.clone(), &gradients, learning_rate);
        Ok(())
    }

    /// A step of the network of expected light; `stream` draws what of it is left out.
    pub fn expected_step(
        &mut self,
        examples: &[&ExpectedExample],
        stream: &mut Stream,
        learning_rate: f64,
        config: &TrainConfig,
    ) -> Result<Progress, Fault> {
        let examples: Vec<_> = examples.iter().map(|example| (&example.statistics, &example.truth)).collect();
        let losses = expected_losses(&self.expected.net, &examples, Some(stream));
        let named = [
            ("log_irradiance", &losses.log_irradiance),
            ("scale_invariant", &losses.scale_invariant),
            ("colour", &losses.colour),
            ("contrast", &losses.contrast),
        ];
        let named = named.map(|(name, loss)| (name, scalar(loss))).to_vec();
        let mut progress = Progress { losses: named, norms: Vec::new() };
        let mut gradients = losses.total().backward();
        let norm = self.expected.descend(EXPECTED_NET, &mut gradients, learning_rate, &|_| 1.0, config);
        progress.norms.push(("expected", norm.map_err(|fault| with_losses(fault, &progress))?));
        Ok(progress)
    }

    /// A step of the light network with a global lighting feature that is not trained.
    pub fn light_step(
        &mut self,
        example: &LightExample,
        global: Vec<f32>,
        own: bool,
        learning_rate: f64,
        config: &TrainConfig,
    ) -> Result<Progress, Fault> {
        let features = global.len();
        let global = Tensor::from_data(TensorData::new(global, [1, features]), &recording());
        let (total, mut progress) = self.light_losses(example, global, own, config)?;
        let mut gradients = total.backward();
        let norm = self.light.descend("light_net", &mut gradients, learning_rate, &|_| 1.0, config);
        progress.norms.push(("light", norm.map_err(|fault| with_losses(fault, &progress))?));
        Ok(progress)
    }

    fn light_losses(
        &self,
        example: &LightExample,
        global: Tensor<2>,
        own: bool,
        config: &TrainConfig,
    ) -> Result<(Tensor<1>, Progress), Fault> {
        let growth = if own { Growth::Predicted } else { Growth::Truth(&example.truth.octree) };
        let output = self.light.net.forward(&example.input, Some(global), growth)?;
        let settings = Settings::default();
        let losses = LightLosses::new(&output, &example.truth, &example.novel, &example.visible, settings)?;
        let total = losses.total(&config.light_losses);
        let named = [
            ("octree", &losses.octree),
            ("novel_radiance", &losses.novel.radiance),
            ("novel_tone", &losses.novel.tone),
            ("novel_irradiance", &losses.novel_irradiance),
            ("novel_distance", &losses.novel.distance),
            ("visible_radiance", &losses.visible.radiance),
            ("visible_distance", &losses.visible.distance),
            ("node_radiance", &losses.node_radiance),
            ("node_error", &losses.node_error),
        ];
        let losses = named.map(|(name, loss)| (name, scalar(loss))).to_vec();
        Ok((total, Progress { losses, norms: Vec::new() }))
    }

    /// A step of both networks on one photo, of which `output` is the depth network's.
    pub fn joint_step(
        &mut self,
        output: DepthOutput,
        depth_example: &DepthExample,
        light_example: &LightExample,
        own: bool,
        learning_rate: f64,
        config: &TrainConfig,
    ) -> Result<Progress, Fault> {
        let (light, lit) = self.light_losses(light_example, output.global.clone(), own, config)?;
        let (depth, judged, mut progress) = self.depth_losses(output, &[depth_example], config);
        progress.losses.extend(lit.losses);
        let mut gradients = (light + depth).backward();
        let norm = self.light.descend("light_net", &mut gradients, learning_rate, &|_| 1.0, config);
        progress.norms.push(("light", norm.map_err(|fault| with_losses(fault, &progress))?));
        let norm = self.depth.descend("depth_net", &mut gradients, learning_rate, &|_| 1.0, config);
        progress.norms.push(("depth", norm.map_err(|fault| with_losses(fault, &progress))?));
        drop(gradients);
        self.discriminator_step(judged, learning_rate * config.discriminator_lr_ratio, &mut progress)?;
        Ok(progress)
    }
}

/// Panoramas for the discriminator.
struct Judged {
    real: Tensor<4>,
    made: Tensor<4>,
    condition: Tensor<4>,
}

fn adam_name(name: &str) -> String {
    format!("adam.{name}")
}

/// Panoramas as `[C, panoramas, height, width]`.
fn channels<'a, const C: usize>(panoramas: impl ExactSizeIterator<Item = &'a [[f32; C]]> + Clone) -> Tensor<4> {
    let size = [C, panoramas.len(), PANORAMA.1, PANORAMA.0];
    let channel = |c: usize| panoramas.clone().flatten().map(move |pixel| pixel[c]);
    Tensor::from_data(TensorData::new((0..C).flat_map(channel).collect::<Vec<f32>>(), size), &recording())
}

/// Names the losses that are no numbers too.
fn with_losses(fault: Fault, progress: &Progress) -> Fault {
    let bad = progress.losses.iter().filter(|(_, value)| !value.is_finite()).map(|(name, _)| *name);
    match fault {
        Fault::Gradient { parameter, .. } => Fault::Gradient { parameter, losses: bad.collect() },
        other => other,
    }
}

fn not_this_run(path: &Path, reason: &str) -> TrainError {
    TrainError::NotThisRun { path: path.to_owned(), reason: reason.to_owned() }
}
