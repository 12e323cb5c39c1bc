use std::path::PathBuf;

use lo_dataset::{CropModel, GeneratorConfig};
use lo_events::Stage;
use lo_nets::depth::{DepthLossConfig, EncoderKind, LONGER_SIDE};
use lo_nets::light::{LightLossConfig, LightNetConfig};
use serde::{Deserialize, Serialize};

use crate::augmentation::AugmentationConfig;
use crate::error::{ConfigError, check_range};
use crate::net_trainer::Descent;
use crate::panorama_data::PanoramaData;
use crate::phases::{
    DepthPhase, ExpectedPhase, LightPhase, Phase, Schedule, depth_phases, expected_phases, joint_phases, light_phases,
};
use crate::training_phase::{TrainedNetworks, TrainingPhase};

/// Configuration of a training run, except its seed. Every field has a default; a file lists only what differs.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct TrainConfig {
    /// Norm to which the gradient of each network is clipped.
    pub clip_norm: f32,
    /// Whether convolutions of the depth network multiply in bf16 in training, on processors with AMX (Intel servers
    /// since 2023). Sums and weights stay f32. No effect on other processors, nor in inference.
    pub bf16: bool,
    /// Decay per step of the exponential moving average of the weights, which is validated and exported. Ramps up
    /// from 0.1.
    #[serde(alias = "average_decay")]
    pub ema_decay: f64,
    /// Learning rate of the discriminator as a share of the depth network's.
    #[serde(alias = "judge_rate")]
    pub discriminator_lr_ratio: f64,
    /// Minutes between checkpoints.
    pub checkpoint_minutes: f64,
    /// Steps per line of the log.
    pub log_steps: u64,
    /// Image encoder of the depth network. `train --encoder-weights` initialises it with published weights.
    pub encoder: EncoderKind,
    /// Longer side in pixels to which inference resizes photos for the depth network. Usually the `photo_width` of the
    /// last depth phase.
    pub longer_side: usize,
    /// Training data.
    pub data: DataConfig,
    /// Data augmentation.
    pub augmentation: AugmentationConfig,
    /// Shape of the light network at its final octree depth. Phases of lesser octree depth train its coarser stages.
    pub network: LightNetConfig,
    /// Weights of the depth network's losses.
    pub depth_losses: DepthLossConfig,
    /// Weights of the light network's losses.
    pub light_losses: LightLossConfig,
    /// Validation on held-out scenes.
    pub validation: ValidationConfig,
    /// Stage 1: the depth network alone.
    #[serde(deserialize_with = "depth_phases")]
    pub depth: Vec<DepthPhase>,
    /// Stage 2: the light network, with a fixed depth network.
    #[serde(deserialize_with = "light_phases")]
    pub light: Vec<LightPhase>,
    /// Stage 3: both networks jointly.
    #[serde(deserialize_with = "joint_phases")]
    pub joint: Vec<LightPhase>,
    /// Stage 4: the network of expected light, on depth from the trained depth network.
    #[serde(deserialize_with = "expected_phases")]
    pub expected: Vec<ExpectedPhase>,
}

/// Training data.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct DataConfig {
    /// Dataset folder in any layout that `lightoctree-lab dataset` supports. Without any data, rooms are generated on
    /// the fly.
    pub folder: Option<PathBuf>,
    /// How photos are cropped from the panoramas of `folder`, if its layout has no photos. The seed is the run's.
    pub crop: CropModel,
    /// Real panoramas to crop photos from. Camera and surrounding light are known; depth only if there is a floor plan.
    pub panoramas: Vec<PanoramaData>,
    /// Real photos with measured depth. Depth and lens are known, light is not.
    pub frames: Vec<FramesData>,
    /// Number of rooms to generate on the fly before they repeat.
    pub generated_rooms: u32,
    /// Generator of these rooms.
    pub generator: GeneratorConfig,
    /// Threads that read or generate samples, beside the one that prepares examples.
    pub threads: usize,
    /// Number of samples to prefetch.
    #[serde(alias = "ahead")]
    pub prefetch: usize,
}

/// A list of photos with measured depth. All of them are training data.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct FramesData {
    /// A `frames.json` file, or a folder that contains one.
    pub list: PathBuf,
    /// Repetitions of each photo per epoch.
    pub repeats: u32,
}

impl Default for FramesData {
    fn default() -> Self {
        Self { list: PathBuf::new(), repeats: 1 }
    }
}

/// Validation on held-out scenes.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ValidationConfig {
    /// Steps between validations. Each phase also ends with one.
    pub every_steps: u64,
    /// Number of photos, each of a different held-out scene; 0 disables validation.
    pub photos: usize,
    /// Rows of the contact sheet; 0 for none.
    pub sheet_rows: usize,
}

impl Default for TrainConfig {
    /// The paper's encoder with random weights, trained on generated rooms. `configs/shipped.toml` starts from
    /// published weights and adds real photos.
    fn default() -> Self {
        let (depth, light) = (DepthPhase::DEFAULT, LightPhase::DEFAULT);
        Self {
            clip_norm: 5.0,
            bf16: true,
            ema_decay: 0.999,
            discriminator_lr_ratio: 0.5,
            checkpoint_minutes: 10.0,
            log_steps: 50,
            encoder: EncoderKind::default(),
            longer_side: LONGER_SIDE,
            data: DataConfig::default(),
            augmentation: AugmentationConfig::default(),
            network: LightNetConfig::default(),
            depth_losses: DepthLossConfig::default(),
            light_losses: LightLossConfig::default(),
            validation: ValidationConfig::default(),
            depth: vec![
                DepthPhase {
                    schedule: Schedule { steps: 3_000, final_share: 0.15, ..depth.schedule },
                    photo_width: 128,
                    ..depth
                },
                DepthPhase {
                    schedule: Schedule { steps: 10_000, learning_rate: 4e-4, final_share: 0.01, ..depth.schedule },
                    batch_size: 8,
                    ..depth
                },
            ],
            light: vec![
                LightPhase {
                    schedule: Schedule { steps: 2_000, learning_rate: 1e-3, final_share: 0.3, ..light.schedule },
                    octree_depth: 5,
                    ..light
                },
                LightPhase {
                    schedule: Schedule { final_share: 0.02, ..light.schedule },
                    octree_depth: 6,
                    scheduled_sampling: [0.0, 0.6],
                    ..light
                },
            ],
            joint: Vec::new(),
            expected: Vec::new(),
        }
    }
}

impl Default for DataConfig {
    fn default() -> Self {
        Self {
            folder: None,
            crop: CropModel::default(),
            panoramas: Vec::new(),
            frames: Vec::new(),
            generated_rooms: 1_000_000,
            generator: GeneratorConfig::default(),
            threads: 1,
            prefetch: 4,
        }
    }
}

impl Default for ValidationConfig {
    fn default() -> Self {
        Self { every_steps: 1_000, photos: 24, sheet_rows: 6 }
    }
}

impl DataConfig {
    /// Checks the ranges of all fields.
    ///
    /// # Errors
    /// See [`ConfigError`].
    pub(crate) fn validate(&self) -> Result<(), ConfigError> {
        self.generator.validate().map_err(|error| ConfigError::Generator(error.to_string()))?;
        check_range("data.threads", self.threads as f64, 1.0, 256.0)?;
        check_range("data.prefetch", self.prefetch as f64, 1.0, 1e4)?;
        check_range("data.generated_rooms", self.generated_rooms.into(), 1.0, u32::MAX.into())?;
        let repeats = |frames: &FramesData| check_range("data.frames.repeats", frames.repeats.into(), 1.0, 1e6);
        self.frames.iter().try_for_each(repeats)
    }
}

impl ValidationConfig {
    /// Checks the ranges of all fields.
    ///
    /// # Errors
    /// [`ConfigError::OutOfRange`].
    pub(crate) fn validate(&self) -> Result<(), ConfigError> {
        check_range("validation.every_steps", self.every_steps as f64, 1.0, 1e12)?;
        check_range("validation.photos", self.photos as f64, 0.0, 1e5)?;
        check_range("validation.sheet_rows", self.sheet_rows as f64, 0.0, 64.0)
    }
}

impl TrainConfig {
    /// Returns all phases in training order.
    pub(crate) fn phases(&self) -> Vec<(TrainingPhase, Phase)> {
        let depth = Phase::numbered(TrainedNetworks::Depth, self.depth.iter().cloned().map(Phase::Depth));
        let light = Phase::numbered(TrainedNetworks::Light, self.light.iter().cloned().map(Phase::Light));
        let joint = Phase::numbered(TrainedNetworks::Joint, self.joint.iter().cloned().map(Phase::Joint));
        let expected = Phase::numbered(TrainedNetworks::Expected, self.expected.iter().cloned().map(Phase::Expected));
        depth.into_iter().chain(light).chain(joint).chain(expected).collect()
    }

    /// Returns the options of every optimiser's steps.
    pub(crate) fn descent(&self) -> Descent {
        Descent { clip_norm: self.clip_norm, ema_decay: self.ema_decay }
    }

    /// Returns the stages of all phases in training order.
    pub fn phase_stages(&self) -> Vec<Stage> {
        self.phases().iter().map(|(phase, _)| phase.stage()).collect()
    }

    /// Returns the shape of the light network for an octree depth. Its stages are those of the final
    /// network.
    pub(crate) fn network_of(&self, octree_depth: u32) -> LightNetConfig {
        LightNetConfig {
            depth: octree_depth,
            channels: self.network.stage_channels(octree_depth),
            ..self.network.clone()
        }
    }

    /// Checks the ranges of all fields.
    ///
    /// # Errors
    /// See [`ConfigError`].
    pub fn validate(&self) -> Result<(), ConfigError> {
        self.network.validate()?;
        self.data.validate()?;
        self.validation.validate()?;
        self.augmentation.validate()?;
        check_range("clip_norm", self.clip_norm.into(), 1e-6, 1e6)?;
        check_range("ema_decay", self.ema_decay, 0.0, 0.999_999)?;
        check_range("discriminator_lr_ratio", self.discriminator_lr_ratio, 0.0, 100.0)?;
        check_range("checkpoint_minutes", self.checkpoint_minutes, 0.0, 1e6)?;
        check_range("log_steps", self.log_steps as f64, 1.0, 1e9)?;
        check_range("longer_side", self.longer_side as f64, 32.0, 1024.0)?;
        let (full, finest) = (f64::from(self.network.full_depth), f64::from(self.network.depth));
        let mut shallowest = full;
        for (name, phase) in self.phases() {
            let check_range = |what: &str, value, min, max| check_range(&format!("{name}: {what}"), value, min, max);
            let schedule = phase.schedule();
            check_range("steps", schedule.steps as f64, 1.0, 1e12)?;
            check_range("learning_rate", schedule.learning_rate, 0.0, 1.0)?;
            check_range("final_share", schedule.final_share, 0.0, 1.0)?;
            match &phase {
                Phase::Depth(p) => {
                    check_range("photo_width", p.photo_width as f64, 32.0, 4096.0)?;
                    check_range("batch_size", p.batch_size as f64, 1.0, 256.0)?;
                    check_range("encoder_lr_ratio", p.encoder_lr_ratio.into(), 0.0, 1.0)?;
                }
                Phase::Expected(p) => {
                    check_range("batch_size", p.batch_size as f64, 1.0, 4096.0)?;
                    check_range("photos", p.photos as f64, 1.0, 1e6)?;
                    p.augmentation.validate()?;
                }
                Phase::Light(p) | Phase::Joint(p) => {
                    check_range("octree_depth", p.octree_depth.into(), shallowest, finest)?;
                    shallowest = p.octree_depth.into();
                    for share in p.scheduled_sampling {
                        check_range("scheduled_sampling", share.into(), 0.0, 1.0)?;
                    }
                    check_range("predicted_share", p.predicted_share.into(), 0.0, 1.0)?;
                    check_range("sensor_share", p.sensor_share.into(), 0.0, 1.0)?;
                    check_range("novel_rays + visible_rays", (p.novel_rays + p.visible_rays) as f64, 1.0, 1e7)?;
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
        let light = |phase| TrainConfig { light: vec![LightPhase::DEFAULT, phase], ..TrainConfig::default() };
        let message = |config: TrainConfig| config.validate().unwrap_err().to_string();
        let shallower = light(LightPhase { octree_depth: 6, ..LightPhase::DEFAULT });
        assert_eq!(message(shallower), "light 2/2: octree_depth is 6; it must be between 7 and 7");
        let share = light(LightPhase { sensor_share: 1.5, ..LightPhase::DEFAULT });
        assert_eq!(message(share), "light 2/2: sensor_share is 1.5; it must be between 0 and 1");
        let none = TrainConfig { log_steps: 0, ..TrainConfig::default() };
        assert_eq!(message(none), "log_steps is 0; it must be between 1 and 1000000000");
    }

    #[test]
    fn what_lies_in_configs_is_valid() {
        let [shipped, recipe, expected, _] = [
            include_str!("../../../../configs/shipped.toml"),
            include_str!("../../../../configs/recipe.toml"),
            include_str!("../../../../configs/expected.toml"),
            include_str!("../../../../configs/recipe_depth.toml"),
        ]
        .map(|text| {
            let config: TrainConfig = toml::from_str(text).unwrap();
            assert_eq!(config.validate(), Ok(()));
            config
        });
        for config in [shipped, recipe] {
            assert_eq!(config.expected, expected.expected, "one stage, alone and in the recipes");
        }
        let rooms = [include_str!("../../../../configs/rooms.toml"), include_str!("../../../../configs/photos.toml")];
        for text in rooms {
            assert!(toml::from_str::<GeneratorConfig>(text).unwrap().validate().is_ok());
        }
    }

    #[test]
    fn every_field_survives_toml() {
        let config = TrainConfig::default();
        let text = toml::to_string(&config).unwrap();
        assert_eq!(toml::from_str::<TrainConfig>(&text).unwrap(), config);
    }

    #[test]
    fn what_a_file_does_not_name_is_as_usual_and_what_is_unknown_an_error() {
        let read = toml::from_str::<TrainConfig>;
        let config = read("[[depth]]\n[[light]]\nsteps = 3\n[[joint]]\nlearning_rate = 1\n").unwrap();
        assert_eq!(config.depth, [DepthPhase::DEFAULT]);
        let schedule = Schedule { steps: 3, ..LightPhase::DEFAULT.schedule };
        assert_eq!(config.light, [LightPhase { schedule, ..LightPhase::DEFAULT }]);
        let schedule = Schedule { learning_rate: 1.0, ..LightPhase::DEFAULT_JOINT.schedule };
        assert_eq!(config.joint, [LightPhase { schedule, ..LightPhase::DEFAULT_JOINT }]);
        let message = |text| read(text).unwrap_err().to_string();
        for (text, field) in [
            ("[[light]]\nstep = 3", "step"),
            ("[[depth]]\noctree_depth = 6", "octree_depth"),
            ("[[joint]]\nbatch_size = 2", "batch_size"),
            ("[data]\nfolders = 'rooms'", "folders"),
        ] {
            assert!(message(text).contains(&format!("unknown field `{field}`")), "{}", message(text));
        }
        let twice = message("[[light]]\nrate = 0.1\nlearning_rate = 0.1");
        assert!(twice.contains("duplicate field `learning_rate`"), "{twice}");
        assert!(message("[[light]]\nsteps = 'many'").contains("invalid type: string \"many\", expected u64"));
    }

    /// Reads a file with the former names of fields.
    #[test]
    fn former_names_are_read() {
        let former = "average_decay = 0.98\njudge_rate = 0.25\n[data]\nahead = 7\n[[depth]]\nrate = 2e-4\n\
            [[light]]\nrate = 3e-4\nown_growth = [0.2, 0.5]\n[[joint]]\nrate = 4e-4\nown_growth = [0.1, 0.9]\n";
        let now = "ema_decay = 0.98\ndiscriminator_lr_ratio = 0.25\n[data]\nprefetch = 7\n[[depth]]\nlearning_rate = 2e-4\n\
            [[light]]\nlearning_rate = 3e-4\nscheduled_sampling = [0.2, 0.5]\n\
            [[joint]]\nlearning_rate = 4e-4\nscheduled_sampling = [0.1, 0.9]\n";
        let [former, now] = [former, now].map(|text| toml::from_str::<TrainConfig>(text).unwrap());
        assert_eq!(former, now);
        assert_eq!((now.ema_decay, now.discriminator_lr_ratio, now.data.prefetch), (0.98, 0.25, 7));
        assert_eq!(now.light[0].scheduled_sampling, [0.2, 0.5]);
        assert_eq!([now.depth[0].schedule, now.joint[0].schedule].map(|s| s.learning_rate), [2e-4, 4e-4]);
    }
}
