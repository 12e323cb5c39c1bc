use lo_baselines::System;
use lo_events::Stage;
use serde::{Deserialize, Serialize};

use crate::augmentation::AugmentationConfig;
use crate::config::{DataConfig, ValidationConfig};
use crate::error::{ConfigError, check_range};
use crate::net_trainer::Descent;
use crate::phases::Schedule;
use crate::training_phase::{TrainedNetworks, TrainingPhase};

/// Configuration of a baseline's training, except its seed. Every field has a default.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct BaselineConfig {
    /// The system to train.
    pub system: System,
    /// Number of steps.
    pub steps: u64,
    /// Photos per step.
    pub batch_size: usize,
    /// Peak learning rate.
    pub learning_rate: f64,
    /// Steps of linear warm-up to the peak.
    pub warm_up_steps: u64,
    /// Final learning rate as a share of the peak, reached by cosine decay.
    pub final_share: f64,
    /// Photos in the pool that batches are drawn from. Their features are computed once.
    pub photos: usize,
    /// Points in front of each photo's surfaces at which the true light is rendered, for systems of local light.
    pub probes: usize,
    /// Norm to which the gradient is clipped.
    pub clip_norm: f32,
    /// Decay per step of the exponential moving average of the weights, which is validated and exported.
    pub ema_decay: f64,
    /// Minutes between checkpoints.
    pub checkpoint_minutes: f64,
    /// Steps per line of the log.
    pub log_steps: u64,
    /// Training data. Photos need depth and surface points; lists of photos with depth alone are of no use.
    pub data: DataConfig,
    /// Data augmentation, except of the focal length. `variants` bounds how many examples a photo makes; `style` is not
    /// used.
    pub augmentation: AugmentationConfig,
    /// Validation on held-out rooms. There is no contact sheet.
    pub validation: ValidationConfig,
}

impl Default for BaselineConfig {
    fn default() -> Self {
        Self {
            system: System::Gardner2017,
            steps: 6_000,
            batch_size: 12,
            learning_rate: 1e-3,
            warm_up_steps: 100,
            final_share: 0.02,
            photos: 2_400,
            probes: 10,
            clip_norm: 5.0,
            ema_decay: 0.998,
            checkpoint_minutes: 5.0,
            log_steps: 100,
            data: DataConfig::default(),
            augmentation: AugmentationConfig { variants: 4, focal: 0.0, ..AugmentationConfig::default() },
            validation: ValidationConfig { every_steps: 1_000, photos: 40, sheet_rows: 0 },
        }
    }
}

impl BaselineConfig {
    /// Returns the stage that reports the steps.
    pub fn stage(&self) -> Stage {
        self.phase().stage()
    }

    pub(super) fn phase(&self) -> TrainingPhase {
        TrainingPhase { networks: TrainedNetworks::Baseline(self.system), number: 1, of: 1 }
    }

    pub(super) fn schedule(&self) -> Schedule {
        let Self { steps, learning_rate, warm_up_steps, final_share, .. } = *self;
        Schedule { steps, learning_rate, warm_up_steps, final_share }
    }

    pub(super) fn descent(&self) -> Descent {
        Descent { clip_norm: self.clip_norm, ema_decay: self.ema_decay }
    }

    /// Returns how the photos of the pool are varied.
    pub(super) fn variations(&self) -> AugmentationConfig {
        // A wrong focal length would distort normals and panoramas.
        AugmentationConfig { focal: 0.0, ..self.augmentation.clone() }
    }

    /// Checks the ranges of all fields.
    ///
    /// # Errors
    /// See [`ConfigError`].
    pub fn validate(&self) -> Result<(), ConfigError> {
        self.data.validate()?;
        self.augmentation.validate()?;
        self.validation.validate()?;
        check_range("steps", self.steps as f64, 1.0, 1e12)?;
        check_range("batch_size", self.batch_size as f64, 1.0, 4096.0)?;
        check_range("learning_rate", self.learning_rate, 0.0, 1.0)?;
        check_range("final_share", self.final_share, 0.0, 1.0)?;
        check_range("photos", self.photos as f64, 1.0, 1e6)?;
        check_range("probes", self.probes as f64, 1.0, 1024.0)?;
        check_range("clip_norm", self.clip_norm.into(), 1e-6, 1e6)?;
        check_range("ema_decay", self.ema_decay, 0.0, 0.999_999)?;
        check_range("checkpoint_minutes", self.checkpoint_minutes, 0.0, 1e6)?;
        check_range("log_steps", self.log_steps as f64, 1.0, 1e9)
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn what_lies_in_configs_is_valid_and_named_after_its_system() {
        for (system, text) in [
            (System::Gardner2017, include_str!("../../../../../configs/baselines/gardner2017.toml")),
            (System::Nir2019, include_str!("../../../../../configs/baselines/nir2019.toml")),
            (System::DeepLight2019, include_str!("../../../../../configs/baselines/deeplight2019.toml")),
            (System::Garon2019, include_str!("../../../../../configs/baselines/garon2019.toml")),
            (System::Li2020, include_str!("../../../../../configs/baselines/li2020.toml")),
            (System::Lighthouse2020, include_str!("../../../../../configs/baselines/lighthouse2020.toml")),
        ] {
            let config: BaselineConfig = toml::from_str(text).unwrap();
            assert_eq!((config.validate(), config.system), (Ok(()), system));
            assert_eq!(toml::from_str::<BaselineConfig>(&toml::to_string(&config).unwrap()).unwrap(), config);
        }
        assert_eq!(System::ALL.len(), 6);
    }

    #[test]
    fn what_is_out_of_range_is_named() {
        let message = |text: &str| toml::from_str::<BaselineConfig>(text).unwrap().validate().unwrap_err().to_string();
        assert_eq!(message("probes = 0"), "probes is 0; it must be between 1 and 1024");
        assert_eq!(message("[data]\nthreads = 0"), "data.threads is 0; it must be between 1 and 256");
        let unknown = toml::from_str::<BaselineConfig>("system = \"gardner\"").unwrap_err().to_string();
        assert!(unknown.contains("unknown variant `gardner`, expected one of `gardner2017`"), "{unknown}");
    }
}
