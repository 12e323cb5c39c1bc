use std::path::PathBuf;

use dataset::GeneratorConfig;
use nets::depth::DepthLossConfig;
use nets::light::{LightLossConfig, LightNetConfig};
use serde::{Deserialize, Serialize};

use crate::AugmentationConfig;

/// All that a training run is made of, but its seed. Every field has a default, so that a file need name only what differs.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct TrainConfig {
    /// Greatest norm of the gradient of a network; a longer one is shortened to it.
    pub clip_norm: f32,
    /// Whether the depth network's convolutions multiply in bf16 in training, where the processor has a matrix unit for that (Intel's AMX, servers since
    /// 2023): sums, weights and all else stay f32. Elsewhere, and in use, nothing changes.
    pub bf16: bool,
    /// Share of the averaged weights that stays at a step; what is validated and exported are these. It rises to this value from 0.1.
    pub average_decay: f64,
    /// Learning rate of the discriminator, as a share of the depth network's.
    pub judge_rate: f64,
    /// Minutes between checkpoints.
    pub checkpoint_minutes: f64,
    /// Steps whose mean makes a line of the log.
    pub log_steps: u64,
    /// Where samples come from.
    pub data: DataConfig,
    /// What a sample is varied by.
    pub augmentation: AugmentationConfig,
    /// Shape of the light network at its finest; phases of a lesser octree depth train its coarser stages.
    pub network: LightNetConfig,
    /// Weights of the depth network's losses.
    pub depth_losses: DepthLossConfig,
    /// Weights of the light network's losses.
    pub light_losses: LightLossConfig,
    /// Figures on held-out scenes.
    pub validation: ValidationConfig,
    /// Stage 1: the depth network alone.
    pub depth: Vec<DepthPhase>,
    /// Stage 2: the light network on known depth and the trained depth network's global features.
    pub light: Vec<LightPhase>,
    /// Stage 3: both, the light network also on predicted depth.
    pub joint: Vec<JointPhase>,
}

/// Where samples come from.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct DataConfig {
    /// A folder in a layout that `lightoctree dataset` knows: shards of `lightoctree synth`, or published data. Rooms are generated on the
    /// fly where none is named.
    pub folder: Option<PathBuf>,
    /// Rooms that are generated on the fly, before they come again.
    pub generated_rooms: u32,
    /// What these are like.
    pub generator: GeneratorConfig,
    /// Threads that read or generate samples, beside the one that prepares them.
    pub threads: usize,
    /// Most samples made ahead.
    pub ahead: usize,
}

/// Figures on held-out scenes.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ValidationConfig {
    /// Steps between validations; each phase ends with one.
    pub every_steps: u64,
    /// Photos, each of another held-out scene.
    pub photos: usize,
    /// Rows of the contact sheet.
    pub sheet_rows: usize,
}

/// A part of stage 1.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct DepthPhase {
    /// Steps.
    pub steps: u64,
    /// Photos a step, all of one size. More than one are faster than as many steps, and normalised together.
    pub batch_size: usize,
    /// Greatest learning rate.
    pub rate: f64,
    /// Steps in which the learning rate rises to it.
    pub warm_up_steps: u64,
    /// Share of the rate that is left at the end, after a half cosine.
    pub final_share: f64,
    /// Width of the photos in pixels, of upright ones the height; smaller ones are faster. The network is used on 240.
    pub photo_width: usize,
    /// Normalise by the running statistics, as in use, instead of those of the photos at hand.
    pub frozen_statistics: bool,
}

/// A part of stage 2.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct LightPhase {
    /// Steps, each of one photo.
    pub steps: u64,
    /// Greatest learning rate.
    pub rate: f64,
    /// Steps in which the learning rate rises to it.
    pub warm_up_steps: u64,
    /// Share of the rate that is left at the end, after a half cosine.
    pub final_share: f64,
    /// Depth of the octree.
    pub octree_depth: u32,
    /// Share of the steps whose octree grows by the network's own predictions, at the beginning and at the end.
    pub own_growth: [f32; 2],
    /// Share of the samples whose depth the depth network, which stays as it is, predicts.
    pub predicted_share: f32,
    /// Share of the others that come with a sensor's depth instead of the true one.
    pub sensor_share: f32,
    /// Rays of novel views a step.
    pub novel_rays: usize,
    /// Rays of the photo a step.
    pub visible_rays: usize,
}

/// A part of stage 3.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct JointPhase {
    /// Steps, each of one photo.
    pub steps: u64,
    /// Greatest learning rate.
    pub rate: f64,
    /// Steps in which the learning rate rises to it.
    pub warm_up_steps: u64,
    /// Share of the rate that is left at the end, after a half cosine.
    pub final_share: f64,
    /// Depth of the octree.
    pub octree_depth: u32,
    /// Share of the steps whose octree grows by the network's own predictions, at the beginning and at the end.
    pub own_growth: [f32; 2],
    /// Share of the samples whose depth is predicted.
    pub predicted_share: f32,
    /// Share of the others that come with a sensor's depth instead of the true one.
    pub sensor_share: f32,
    /// Rays of novel views a step.
    pub novel_rays: usize,
    /// Rays of the photo a step.
    pub visible_rays: usize,
}

impl Default for TrainConfig {
    /// The recipe of `configs/two-cores.toml`, with rooms generated on the fly.
    fn default() -> Self {
        let depth = DepthPhase::default();
        let light = LightPhase::default();
        Self {
            clip_norm: 5.0,
            bf16: true,
            average_decay: 0.999,
            judge_rate: 0.5,
            checkpoint_minutes: 10.0,
            log_steps: 50,
            data: DataConfig::default(),
            augmentation: AugmentationConfig::default(),
            network: LightNetConfig::default(),
            depth_losses: DepthLossConfig {
                log_depth: 0.25,
                absolute: 1.0,
                adversarial: 0.0,
                ..DepthLossConfig::default()
            },
            light_losses: LightLossConfig::default(),
            validation: ValidationConfig::default(),
            depth: vec![
                DepthPhase { steps: 3_000, final_share: 0.15, photo_width: 128, ..depth.clone() },
                DepthPhase { steps: 10_000, batch_size: 8, rate: 4e-4, final_share: 0.01, ..depth },
            ],
            light: vec![
                LightPhase { steps: 2_000, rate: 1e-3, final_share: 0.3, octree_depth: 5, ..light.clone() },
                LightPhase { final_share: 0.02, octree_depth: 6, own_growth: [0.0, 0.6], ..light },
            ],
            joint: Vec::new(),
        }
    }
}

impl Default for DataConfig {
    fn default() -> Self {
        Self { folder: None, generated_rooms: 1_000_000, generator: GeneratorConfig::default(), threads: 1, ahead: 4 }
    }
}

impl Default for ValidationConfig {
    fn default() -> Self {
        Self { every_steps: 1_000, photos: 24, sheet_rows: 6 }
    }
}

impl Default for DepthPhase {
    fn default() -> Self {
        Self {
            steps: 6_000,
            batch_size: 16,
            rate: 1e-3,
            warm_up_steps: 200,
            final_share: 0.05,
            photo_width: 240,
            frozen_statistics: false,
        }
    }
}

impl Default for LightPhase {
    fn default() -> Self {
        Self {
            steps: 6_000,
            rate: 7e-4,
            warm_up_steps: 200,
            final_share: 0.05,
            octree_depth: 7,
            own_growth: [0.0, 0.0],
            predicted_share: 0.4,
            sensor_share: 0.5,
            novel_rays: 6144,
            visible_rays: 2048,
        }
    }
}

impl Default for JointPhase {
    fn default() -> Self {
        Self {
            steps: 4_000,
            rate: 1e-4,
            warm_up_steps: 200,
            final_share: 0.05,
            octree_depth: 7,
            own_growth: [0.5, 1.0],
            predicted_share: 0.5,
            sensor_share: 0.5,
            novel_rays: 6144,
            visible_rays: 2048,
        }
    }
}

/// A part of a run, of whichever stage.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Phase {
    Depth(DepthPhase),
    Light(LightPhase),
    Joint(JointPhase),
}

impl Phase {
    pub fn steps(&self) -> u64 {
        match self {
            Self::Depth(phase) => phase.steps,
            Self::Light(phase) => phase.steps,
            Self::Joint(phase) => phase.steps,
        }
    }

    /// Samples of a step.
    pub fn batch_size(&self) -> usize {
        match self {
            Self::Depth(phase) => phase.batch_size,
            Self::Light(_) | Self::Joint(_) => 1,
        }
    }

    /// Depth of the octree, where there is one.
    pub fn octree_depth(&self) -> Option<u32> {
        match self {
            Self::Depth(_) => None,
            Self::Light(phase) => Some(phase.octree_depth),
            Self::Joint(phase) => Some(phase.octree_depth),
        }
    }

    /// Learning rate of a step: a line up to the greatest, then half a cosine down to its final share.
    pub fn rate(&self, step: u64) -> f64 {
        let (steps, rate, warm_up, share) = match self {
            Self::Depth(p) => (p.steps, p.rate, p.warm_up_steps, p.final_share),
            Self::Light(p) => (p.steps, p.rate, p.warm_up_steps, p.final_share),
            Self::Joint(p) => (p.steps, p.rate, p.warm_up_steps, p.final_share),
        };
        if step < warm_up {
            return rate * (step + 1) as f64 / warm_up as f64;
        }
        let done = (step - warm_up) as f64 / steps.saturating_sub(warm_up).max(1) as f64;
        let cosine = 0.5 * (1.0 + (std::f64::consts::PI * done.min(1.0)).cos());
        rate * (share + (1.0 - share) * cosine)
    }
}

/// A share that goes from one value to another over a phase.
pub(crate) fn between(ends: [f32; 2], step: u64, steps: u64) -> f32 {
    ends[0] + (ends[1] - ends[0]) * (step as f32 / steps.max(1) as f32)
}

impl TrainConfig {
    /// The phases in the order in which they are trained.
    pub(crate) fn phases(&self) -> Vec<(String, Phase)> {
        fn named<P: Clone>(name: &str, phases: &[P], of: fn(P) -> Phase) -> Vec<(String, Phase)> {
            let count = phases.len();
            let name = |i: usize| if count == 1 { name.to_owned() } else { format!("{name} {}/{count}", i + 1) };
            phases.iter().cloned().enumerate().map(|(i, phase)| (name(i), of(phase))).collect()
        }
        let mut phases = named("depth", &self.depth, Phase::Depth);
        phases.extend(named("light", &self.light, Phase::Light));
        phases.extend(named("joint", &self.joint, Phase::Joint));
        phases
    }

    /// The light network of an octree depth: the coarser stages are those of the finest network.
    pub(crate) fn network_of(&self, octree_depth: u32) -> LightNetConfig {
        LightNetConfig {
            depth: octree_depth,
            channels: self.network.stage_channels(octree_depth),
            ..self.network.clone()
        }
    }

    /// Checks what types cannot say.
    ///
    /// # Errors
    /// Names the field and its range.
    pub fn validate(&self) -> Result<(), String> {
        self.network.validate().map_err(|error| format!("network: {error}"))?;
        self.data.generator.validate().map_err(|error| format!("data.generator: {error}"))?;
        self.augmentation.validate().map_err(|error| format!("augmentation: {error}"))?;
        let inside = |what: &str, value: f64, least: f64, most: f64| match (least..=most).contains(&value) {
            true => Ok(()),
            false => Err(format!("{what} is {value}; it must lie in {least} to {most}")),
        };
        inside("clip_norm", self.clip_norm.into(), 1e-6, 1e6)?;
        inside("average_decay", self.average_decay, 0.0, 0.999_999)?;
        inside("judge_rate", self.judge_rate, 0.0, 100.0)?;
        inside("checkpoint_minutes", self.checkpoint_minutes, 0.0, 1e6)?;
        inside("log_steps", self.log_steps as f64, 1.0, 1e9)?;
        inside("data.threads", self.data.threads as f64, 1.0, 256.0)?;
        inside("data.ahead", self.data.ahead as f64, 1.0, 1e4)?;
        inside("data.generated_rooms", self.data.generated_rooms.into(), 1.0, u32::MAX.into())?;
        inside("validation.every_steps", self.validation.every_steps as f64, 1.0, 1e12)?;
        inside("validation.photos", self.validation.photos as f64, 0.0, 1e5)?;
        inside("validation.sheet_rows", self.validation.sheet_rows as f64, 0.0, 64.0)?;
        let (full, finest) = (f64::from(self.network.full_depth), f64::from(self.network.depth));
        let mut shallowest = full;
        for (name, phase) in self.phases() {
            let inside = |what: &str, value, least, most| inside(&format!("{name}: {what}"), value, least, most);
            let shares =
                |p: &[(&str, f32)]| p.iter().try_for_each(|(what, share)| inside(what, (*share).into(), 0.0, 1.0));
            inside("steps", phase.steps() as f64, 1.0, 1e12)?;
            let (rate, share) = match &phase {
                Phase::Depth(p) => (p.rate, p.final_share),
                Phase::Light(p) => (p.rate, p.final_share),
                Phase::Joint(p) => (p.rate, p.final_share),
            };
            inside("rate", rate, 0.0, 1.0)?;
            inside("final_share", share, 0.0, 1.0)?;
            if let Some(depth) = phase.octree_depth() {
                inside("octree_depth", depth.into(), shallowest, finest)?;
                shallowest = depth.into();
            }
            match &phase {
                Phase::Depth(p) => {
                    inside("photo_width", p.photo_width as f64, 32.0, 4096.0)?;
                    inside("batch_size", p.batch_size as f64, 1.0, 256.0)?;
                }
                Phase::Light(p) => {
                    shares(&[
                        ("own_growth", p.own_growth[0]),
                        ("own_growth", p.own_growth[1]),
                        ("predicted_share", p.predicted_share),
                        ("sensor_share", p.sensor_share),
                    ])?;
                    inside("novel_rays + visible_rays", (p.novel_rays + p.visible_rays) as f64, 1.0, 1e7)?;
                }
                Phase::Joint(p) => {
                    shares(&[("own_growth", p.own_growth[0]), ("own_growth", p.own_growth[1])])?;
                    shares(&[("sensor_share", p.sensor_share), ("predicted_share", p.predicted_share)])?;
                    inside("novel_rays + visible_rays", (p.novel_rays + p.visible_rays) as f64, 1.0, 1e7)?;
                }
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn rates_rise_and_fall() {
        let phase = Phase::Light(LightPhase {
            steps: 110,
            rate: 1e-3,
            warm_up_steps: 10,
            final_share: 0.2,
            ..LightPhase::default()
        });
        let close =
            |step, expected: f64| assert!((phase.rate(step) - expected).abs() < 1e-12, "{step}: {}", phase.rate(step));
        close(0, 1e-4);
        close(9, 1e-3);
        close(10, 1e-3);
        // Half of the cosine is the middle between 1 and the final share.
        close(60, 0.6e-3);
        close(110, 0.2e-3);
    }

    #[test]
    fn coarser_networks_have_the_stages_of_the_finest() {
        let config = TrainConfig::default();
        for depth in 5..=7 {
            let network = config.network_of(depth);
            network.validate().unwrap();
            for stage in 4..=depth {
                assert_eq!(network.stage_channels(stage), config.network.stage_channels(stage));
            }
        }
    }

    #[test]
    fn what_is_out_of_range_is_named() {
        assert_eq!(TrainConfig::default().validate(), Ok(()));
        let light = |phase| TrainConfig { light: vec![LightPhase::default(), phase], ..TrainConfig::default() };
        let message = |config: TrainConfig| config.validate().unwrap_err();
        let shallower = light(LightPhase { octree_depth: 6, ..LightPhase::default() });
        assert_eq!(message(shallower), "light 2/2: octree_depth is 6; it must lie in 7 to 7");
        let share = light(LightPhase { sensor_share: 1.5, ..LightPhase::default() });
        assert_eq!(message(share), "light 2/2: sensor_share is 1.5; it must lie in 0 to 1");
        let none = TrainConfig { log_steps: 0, ..TrainConfig::default() };
        assert_eq!(message(none), "log_steps is 0; it must lie in 1 to 1000000000");
    }

    #[test]
    fn the_recipe_is_the_default() {
        let recipe: TrainConfig = toml::from_str(include_str!("../../../configs/two-cores.toml")).unwrap();
        assert_eq!(recipe, TrainConfig::default());
        let rooms: GeneratorConfig = toml::from_str(include_str!("../../../configs/rooms.toml")).unwrap();
        assert_eq!(rooms.validate(), Ok(()));
    }

    #[test]
    fn every_field_survives_toml() {
        let config = TrainConfig::default();
        let text = toml::to_string(&config).unwrap();
        assert_eq!(toml::from_str::<TrainConfig>(&text).unwrap(), config);
        assert!(
            toml::from_str::<TrainConfig>("[[light]]\nstep = 3").unwrap_err().to_string().contains("unknown field")
        );
    }
}
