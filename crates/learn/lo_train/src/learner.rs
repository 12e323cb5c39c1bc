//! Networks in training: weights, optimisers, averages, and one step of each stage.

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
use crate::error::{ConfigError, StepError, TrainError};
use crate::example::{DepthExample, ExpectedExample, LightExample, PANORAMA};
use crate::net_trainer::NetTrainer;
use crate::phases::DepthPhase;
use crate::transfer::transfer_stages;
use crate::weights::gradient_norm;

/// Prefixes in a checkpoint. Averages have the names of [`Networks`], so that a checkpoint is also a weights file.
const DEPTH: &str = "training.depth_net";
const LIGHT: &str = "training.light_net";
const EXPECTED: &str = "training.expected_light";
const DISCRIMINATOR: &str = "training.discriminator";

/// Losses and gradient norms of a step.
#[derive(Debug, Default)]
pub(crate) struct Progress {
    /// Name and unweighted value.
    pub losses: Vec<(&'static str, f32)>,
    /// Norms of the gradients before clipping.
    pub norms: Vec<(&'static str, f32)>,
}

/// All networks of a run.
#[derive(Debug)]
pub(crate) struct Learner {
    pub depth: NetTrainer<DepthNet>,
    pub light: NetTrainer<LightNet>,
    pub expected: NetTrainer<ExpectedLightNet>,
    /// Current shape of the light network.
    pub network: LightNetConfig,
    discriminator: PatchGan,
    discriminator_adam: Adam,
}

/// Configurations of the networks, and steps since their averages began.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(crate) struct LearnerState {
    #[serde(flatten)]
    depth: DepthNetConfig,
    network: LightNetConfig,
    averaged: [u64; 2],
    /// Steps of the average of the network of expected light.
    #[serde(default)]
    averaged_expected: u64,
}

/// Returns the device that records gradients.
fn recording() -> Device {
    Device::flex().autodiff()
}

fn untrained_expected(seed: u64) -> NetTrainer<ExpectedLightNet> {
    let [net, average] = [recording(), Device::flex()].map(|device| ExpectedLightNet::new(seed, &device));
    NetTrainer { net, average, adam: Adam::default(), steps: 0 }
}

fn scalar(loss: &Tensor<1>) -> f32 {
    loss.clone().inner().into_scalar::<f32>()
}

impl Learner {
    /// Creates untrained networks, the light network for this octree depth.
    ///
    /// # Errors
    /// An invalid shape of the light network.
    pub fn new(config: &TrainConfig, octree_depth: u32, seed: u64) -> Result<Self, LightConfigError> {
        let network = config.network_of(octree_depth);
        let features = network.global_features;
        let plain = || Device::flex();
        let mut discriminator_adam = Adam::default();
        // Isola et al. 2017.
        discriminator_adam.beta1 = 0.5;
        Ok(Self {
            depth: NetTrainer {
                net: DepthNet::new(config.encoder, features, seed, &recording()).with_longer_side(config.longer_side),
                average: DepthNet::new(config.encoder, features, seed, &plain()).with_longer_side(config.longer_side),
                adam: Adam::default(),
                steps: 0,
            },
            light: NetTrainer {
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

    /// Initialises the depth network's encoder with published weights.
    ///
    /// # Errors
    /// Missing tensors or different shapes.
    pub fn load_encoder(&mut self, weights: &Checkpoint) -> Result<(), CheckpointError> {
        self.depth.net.encoder = self.depth.net.encoder.clone().load_published(weights)?;
        self.depth.average.encoder = self.depth.average.encoder.clone().load_published(weights)?;
        Ok(())
    }

    /// Initialises all networks from a weights file; the light network is converted to the current octree depth.
    ///
    /// # Errors
    /// Unreadable files; shapes that differ from the configuration.
    pub fn load(&mut self, path: &Path, config: &TrainConfig, seed: u64) -> Result<(), TrainError> {
        // Read twice: clones share running statistics.
        let (start, average) = (Networks::read(path)?, Networks::read(path)?);
        let own = &start.config;
        let wanted = config.network_of(own.depth);
        if *own != wanted {
            return Err(not_this_run(
                path,
                "the shape of its light network differs from [network] in the configuration",
            ));
        }
        self.set_depth(path, [start.depth, average.depth], config)?;
        if let (Some(net), Some(average)) = (start.expected, average.expected) {
            self.expected = NetTrainer { net: net.train(), average, adam: Adam::default(), steps: 1 };
        }
        let light = |old: &LightNet, device: &Device| {
            transfer_stages(old, own, &self.network, seed, device).map_err(ConfigError::from)
        };
        (self.light.net, self.light.average) =
            (light(&start.light, &recording())?, light(&average.light, &Device::flex())?);
        Ok(())
    }

    /// Initialises the depth network from a weights file; the light network keeps its random weights.
    ///
    /// # Errors
    /// Unreadable files; an encoder or number of global features that differs from the configuration.
    pub fn load_depth(&mut self, path: &Path, config: &TrainConfig) -> Result<(), TrainError> {
        // Read twice: clones share running statistics.
        let (start, average) = (Networks::read(path)?, Networks::read(path)?);
        if start.config.global_features != config.network.global_features {
            return Err(not_this_run(
                path,
                "its number of global features differs from global_features of [network] in the configuration",
            ));
        }
        self.set_depth(path, [start.depth, average.depth], config)
    }

    /// Sets the depth network and its average, which were read from `path`.
    ///
    /// # Errors
    /// An encoder that differs from the configuration.
    fn set_depth(&mut self, path: &Path, nets: [DepthNet; 2], config: &TrainConfig) -> Result<(), TrainError> {
        let [net, mut average] = nets;
        let encoder = net.encoder_kind();
        if encoder != config.encoder {
            return Err(not_this_run(
                path,
                &format!("its encoder is {encoder}, but the configuration has encoder = \"{}\"", config.encoder),
            ));
        }
        let mut net = net.train();
        // Heads that older weights files lack keep their random weights.
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

    /// Returns the averaged weights, which are used for inference.
    pub fn averages(&self) -> Networks {
        Networks {
            depth: self.depth.average.clone(),
            light: self.light.average.clone(),
            expected: (self.expected.steps > 0).then(|| self.expected.average.clone()),
            config: self.network.clone(),
        }
    }

    /// Returns the averaged weights rounded to 16 bits, as in an exported file; used for validation.
    pub fn exported(&self) -> Networks {
        let mut checkpoint = Checkpoint::default();
        self.averages().add_to(&mut checkpoint);
        checkpoint.round_to_half();
        Networks::from_checkpoint(checkpoint, &Device::flex())
            .expect("the checkpoint was made from networks of this shape")
    }

    /// Adds weights and optimisers to a checkpoint, and returns the remaining state.
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

    /// Restores what [`Learner::add_to`] added.
    ///
    /// # Errors
    /// Missing tensors or different shapes.
    pub fn from_checkpoint(mut checkpoint: Checkpoint, state: &LearnerState) -> Result<Self, CheckpointError> {
        let wrong = |problem| CheckpointError::Weights { module: LIGHT.to_owned(), problems: vec![problem] };
        let LearnerState { depth, network, averaged: [depth_steps, light_steps], averaged_expected } = state;
        let adams = [DEPTH, LIGHT, DISCRIMINATOR].map(|name| checkpoint.load_adam(&adam_name(name)));
        let [depth_adam, light_adam, discriminator_adam] = adams;
        let blank = depth.blank(network.global_features, &Device::flex());
        let depth = checkpoint.take_module(DEPTH, blank)?.train();
        let blank = LightNet::new(network, 0, &Device::flex()).map_err(|error| wrong(error.to_string()))?;
        let light = checkpoint.take_module(LIGHT, blank)?.train();
        // Older checkpoints have no network of expected light.
        let mut expected = untrained_expected(0);
        if checkpoint.values_of(EXPECTED) > 0 {
            let adam = checkpoint.load_adam(&adam_name(EXPECTED))?;
            let net = checkpoint.take_module(EXPECTED, ExpectedLightNet::new(0, &Device::flex()))?.train();
            expected = NetTrainer { net, adam, ..expected };
        }
        let discriminator = checkpoint.take_module(DISCRIMINATOR, PatchGan::new(0, &Device::flex()))?.train();
        let averages = Networks::from_checkpoint(checkpoint, &Device::flex())?;
        if let Some(average) = averages.expected {
            expected = NetTrainer { average, steps: *averaged_expected, ..expected };
        }
        Ok(Self {
            depth: NetTrainer { net: depth, average: averages.depth, adam: depth_adam?, steps: *depth_steps },
            light: NetTrainer { net: light, average: averages.light, adam: light_adam?, steps: *light_steps },
            expected,
            network: network.clone(),
            discriminator,
            discriminator_adam: discriminator_adam?,
        })
    }

    /// Converts the light network to another octree depth.
    ///
    /// Common stages keep their weights, new stages get random weights from `seed`, and the optimiser is reset.
    ///
    /// # Errors
    /// An invalid shape.
    pub fn set_octree_depth(
        &mut self,
        config: &TrainConfig,
        octree_depth: u32,
        seed: u64,
    ) -> Result<(), LightConfigError> {
        let network = config.network_of(octree_depth);
        if network == self.network {
            return Ok(());
        }
        let make = |old: &LightNet, device: &Device| transfer_stages(old, &self.network, &network, seed, device);
        let (net, average) =
            (make(&self.light.net.valid(), &recording())?, make(&self.light.average, &Device::flex())?);
        self.light = NetTrainer { net, average, adam: Adam::default(), steps: 0 };
        self.network = network;
        Ok(())
    }

    /// Sets whether the depth network's encoder normalises by its running statistics during training.
    pub fn freeze_statistics(&mut self, frozen: bool) {
        self.depth.net.encoder.freeze_statistics(frozen);
    }

    /// Checks that all weights are finite.
    ///
    /// # Errors
    /// [`StepError::Weights`].
    pub fn check(&self) -> Result<(), StepError> {
        self.depth.check("depth_net")?;
        self.light.check("light_net")?;
        self.expected.check(EXPECTED_NET)
    }

    /// Takes one step of the depth network and its discriminator on photos of one size.
    pub fn depth_step(
        &mut self,
        examples: &[DepthExample],
        learning_rate: f64,
        phase: &DepthPhase,
        config: &TrainConfig,
    ) -> Result<Progress, StepError> {
        let share = |name: &str| if name.starts_with("encoder.") { phase.encoder_lr_ratio } else { 1.0 };
        let examples: Vec<_> = examples.iter().collect();
        let photos: Vec<_> = examples.iter().map(|example| &example.photo).collect();
        let (total, discriminator_input, mut progress) = if phase.decoder_only {
            let (total, losses) = self.decoder_losses(self.depth.net.forward_detached(&photos), &examples, config);
            (total, None, Progress { losses, norms: Vec::new() })
        } else {
            self.depth_losses(self.depth.net.forward(&photos), &examples, config)
        };
        let mut gradients = total.backward();
        let norm = self.depth.descend("depth_net", &mut gradients, learning_rate, &share, config.descent());
        progress.norms.push(("depth", norm.map_err(|error| with_losses(error, &progress))?));
        drop(gradients);
        self.discriminator_step(discriminator_input, learning_rate * config.discriminator_lr_ratio, &mut progress)?;
        Ok(progress)
    }

    /// Returns the weighted sum of the losses of depth and camera, and their values.
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

    /// Returns the weighted sum of the depth network's losses, the input of the discriminator's step, and the values.
    fn depth_losses(
        &self,
        output: DepthOutput,
        examples: &[&DepthExample],
        config: &TrainConfig,
    ) -> (Tensor<1>, Option<DiscriminatorInput>, Progress) {
        let weights = &config.depth_losses;
        let global = output.global.clone();
        let (mut total, mut losses) = self.decoder_losses(output, examples, config);
        let generated = self.depth.net.panorama.forward(global);
        let truths: Vec<_> = examples.iter().map(|example| example.panorama.as_ref()).collect();
        let [panorama, panorama_tone, panorama_irradiance] = panorama_loss(generated.clone(), &truths);
        losses.extend([
            ("panorama", scalar(&panorama)),
            ("panorama_tone", scalar(&panorama_tone)),
            ("panorama_irradiance", scalar(&panorama_irradiance)),
        ]);
        total = total
            + panorama * weights.panorama
            + panorama_tone * weights.panorama_tone
            + panorama_irradiance * weights.panorama_irradiance;
        let mut discriminator_input = None;
        let truths: Option<Vec<_>> = truths.into_iter().collect();
        if weights.adversarial > 0.0
            && let Some(truths) = truths
        {
            let shown: Vec<_> = examples.iter().map(|example| example.shown()).collect();
            let condition = channels::<4>(shown.iter().map(|shown| shown.pixels()));
            let real = channels::<3>(truths.iter().map(|truth| truth.pixels()));
            let adversarial = self.discriminator.generator_loss(generated.clone(), condition.clone());
            losses.push(("adversarial", scalar(&adversarial)));
            total = total + adversarial * weights.adversarial;
            discriminator_input = Some(DiscriminatorInput { real, generated: generated.detach(), condition });
        }
        (total, discriminator_input, Progress { losses, norms: Vec::new() })
    }

    /// Takes one step of the discriminator; does nothing without input.
    fn discriminator_step(
        &mut self,
        input: Option<DiscriminatorInput>,
        learning_rate: f64,
        progress: &mut Progress,
    ) -> Result<(), StepError> {
        let Some(DiscriminatorInput { real, generated, condition }) = input else { return Ok(()) };
        let loss = self.discriminator.discriminator_loss(real, generated, condition);
        progress.losses.push(("discriminator", scalar(&loss)));
        let gradients = loss.backward();
        gradient_norm(&self.discriminator, &gradients)
            .map_err(|layer| StepError::Gradient { parameter: format!("discriminator.{layer}"), losses: Vec::new() })?;
        self.discriminator = self.discriminator_adam.step(self.discriminator.clone(), &gradients, learning_rate);
        Ok(())
    }

    /// Takes one step of the network of expected light; `stream` draws the dropout.
    pub fn expected_step(
        &mut self,
        examples: &[&ExpectedExample],
        stream: &mut Stream,
        learning_rate: f64,
        config: &TrainConfig,
    ) -> Result<Progress, StepError> {
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
        let norm = self.expected.descend(EXPECTED_NET, &mut gradients, learning_rate, &|_| 1.0, config.descent());
        progress.norms.push(("expected", norm.map_err(|error| with_losses(error, &progress))?));
        Ok(progress)
    }

    /// Takes one step of the light network with a fixed global lighting feature.
    ///
    /// `predicted_growth` grows the octree by the network's own predictions instead of the truth.
    pub fn light_step(
        &mut self,
        example: &LightExample,
        global: Vec<f32>,
        predicted_growth: bool,
        learning_rate: f64,
        config: &TrainConfig,
    ) -> Result<Progress, StepError> {
        let features = global.len();
        let global = Tensor::from_data(TensorData::new(global, [1, features]), &recording());
        let (total, mut progress) = self.light_losses(example, global, predicted_growth, config)?;
        let mut gradients = total.backward();
        let norm = self.light.descend("light_net", &mut gradients, learning_rate, &|_| 1.0, config.descent());
        progress.norms.push(("light", norm.map_err(|error| with_losses(error, &progress))?));
        Ok(progress)
    }

    fn light_losses(
        &self,
        example: &LightExample,
        global: Tensor<2>,
        predicted_growth: bool,
        config: &TrainConfig,
    ) -> Result<(Tensor<1>, Progress), StepError> {
        let growth = if predicted_growth { Growth::Predicted } else { Growth::Truth(&example.truth.octree) };
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

    /// Takes one step of both networks on one photo; `output` is the depth network's output for it.
    pub fn joint_step(
        &mut self,
        output: DepthOutput,
        depth_example: &DepthExample,
        light_example: &LightExample,
        predicted_growth: bool,
        learning_rate: f64,
        config: &TrainConfig,
    ) -> Result<Progress, StepError> {
        let (light, light_progress) =
            self.light_losses(light_example, output.global.clone(), predicted_growth, config)?;
        let (depth, discriminator_input, mut progress) = self.depth_losses(output, &[depth_example], config);
        progress.losses.extend(light_progress.losses);
        let mut gradients = (light + depth).backward();
        let norm = self.light.descend("light_net", &mut gradients, learning_rate, &|_| 1.0, config.descent());
        progress.norms.push(("light", norm.map_err(|error| with_losses(error, &progress))?));
        let norm = self.depth.descend("depth_net", &mut gradients, learning_rate, &|_| 1.0, config.descent());
        progress.norms.push(("depth", norm.map_err(|error| with_losses(error, &progress))?));
        drop(gradients);
        self.discriminator_step(discriminator_input, learning_rate * config.discriminator_lr_ratio, &mut progress)?;
        Ok(progress)
    }
}

/// Panoramas for the discriminator, as of [`channels`].
struct DiscriminatorInput {
    real: Tensor<4>,
    generated: Tensor<4>,
    condition: Tensor<4>,
}

fn adam_name(name: &str) -> String {
    format!("adam.{name}")
}

/// Converts panoramas to a tensor `[C, panoramas, height, width]`.
fn channels<'a, const C: usize>(panoramas: impl ExactSizeIterator<Item = &'a [[f32; C]]> + Clone) -> Tensor<4> {
    let size = [C, panoramas.len(), PANORAMA.1, PANORAMA.0];
    let channel = |c: usize| panoramas.clone().flatten().map(move |pixel| pixel[c]);
    Tensor::from_data(TensorData::new((0..C).flat_map(channel).collect::<Vec<f32>>(), size), &recording())
}

/// Adds the names of the non-finite losses to a gradient error.
fn with_losses(error: StepError, progress: &Progress) -> StepError {
    let bad = progress.losses.iter().filter(|(_, value)| !value.is_finite()).map(|(name, _)| *name);
    match error {
        StepError::Gradient { parameter, .. } => StepError::Gradient { parameter, losses: bad.collect() },
        other => other,
    }
}

fn not_this_run(path: &Path, reason: &str) -> TrainError {
    TrainError::NotThisRun { path: path.to_owned(), reason: reason.to_owned() }
}
