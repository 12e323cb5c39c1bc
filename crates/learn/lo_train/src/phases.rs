//! Phases of a run: their steps, learning rates and examples.

use crate::augmentation::AugmentationConfig;
use crate::panorama_data::PanoramaData;
use crate::training_phase::{TrainedNetworks, TrainingPhase};
use serde::de::{DeserializeOwned, Error};
use serde::{Deserialize, Deserializer, Serialize};

/// Steps and learning rate of a phase.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Schedule {
    /// Number of steps.
    pub steps: u64,
    /// Peak learning rate.
    pub learning_rate: f64,
    /// Steps of linear warm-up to the peak.
    pub warm_up_steps: u64,
    /// Final learning rate as a share of the peak, reached by cosine decay.
    pub final_share: f64,
}

impl Schedule {
    /// Returns the learning rate of a step: linear warm-up, then cosine decay.
    pub fn learning_rate_at(&self, step: u64) -> f64 {
        let (greatest, warm_up, share) = (self.learning_rate, self.warm_up_steps, self.final_share);
        if step < warm_up {
            return greatest * (step + 1) as f64 / warm_up as f64;
        }
        let done = (step - warm_up) as f64 / self.steps.saturating_sub(warm_up).max(1) as f64;
        let cosine = 0.5 * (1.0 + (std::f64::consts::PI * done.min(1.0)).cos());
        greatest * (share + (1.0 - share) * cosine)
    }
}

/// A phase of stage 1, the depth network. In TOML, the fields of the schedule are inline.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DepthPhase {
    /// Steps and learning rate.
    #[serde(flatten)]
    pub schedule: Schedule,
    /// Photos per step, all of one size. They are batch-normalised together.
    pub batch_size: usize,
    /// Longer side of the photos in pixels. Smaller photos train faster.
    pub photo_width: usize,
    /// Whether to normalise by the running statistics, as in inference, instead of the batch's.
    pub frozen_statistics: bool,
    /// Learning rate of the encoder as a share of the other layers'. A low share preserves pretrained features.
    pub encoder_lr_ratio: f32,
    /// Whether to train only the depth and camera decoders. Encoder, `f_L` and single map stay fixed, so that an
    /// existing light network remains valid.
    pub decoder_only: bool,
}

/// A phase of stage 2 or 3, with one photo per step. In TOML, the fields of the schedule are inline.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LightPhase {
    /// Steps and learning rate.
    #[serde(flatten)]
    pub schedule: Schedule,
    /// Depth of the octree.
    pub octree_depth: u32,
    /// Share of steps whose octree grows by the network's own predictions, at the first and the last step.
    pub scheduled_sampling: [f32; 2],
    /// Share of samples with depth predicted by the depth network, which is fixed in stage 2.
    pub predicted_share: f32,
    /// Share of the other samples with sensor depth instead of true depth.
    pub sensor_share: f32,
    /// Rays of novel views per step.
    pub novel_rays: usize,
    /// Rays of the photo per step.
    pub visible_rays: usize,
}

/// A phase of stage 4, expected light. In TOML, the fields of the schedule are inline.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ExpectedPhase {
    /// Steps and learning rate.
    #[serde(flatten)]
    pub schedule: Schedule,
    /// Photos per step.
    pub batch_size: usize,
    /// Photos in the pool that batches are drawn from. They are prepared once, with depth from the depth network.
    pub photos: usize,
    /// Panoramas to crop the photos from. If empty: those of `[data]`, or else all of its data.
    pub panoramas: Vec<PanoramaData>,
    /// Augmentation of these photos.
    pub augmentation: AugmentationConfig,
}

impl ExpectedPhase {
    /// Returns the default fields; focal lengths are not augmented.
    pub fn defaults() -> Self {
        Self {
            schedule: Schedule { steps: 1_200, learning_rate: 2e-3, warm_up_steps: 20, final_share: 0.02 },
            batch_size: 64,
            photos: 3_000,
            panoramas: Vec::new(),
            augmentation: AugmentationConfig { focal: 0.0, zoom: 1.2, variants: 0, ..AugmentationConfig::default() },
        }
    }
}

impl DepthPhase {
    /// Default fields.
    pub const DEFAULT: Self = Self {
        schedule: Schedule { steps: 6_000, learning_rate: 1e-3, warm_up_steps: 200, final_share: 0.05 },
        batch_size: 16,
        photo_width: 240,
        frozen_statistics: false,
        encoder_lr_ratio: 1.0,
        decoder_only: false,
    };
}

impl LightPhase {
    /// Default fields of stage 2.
    pub const DEFAULT: Self = Self {
        schedule: Schedule { steps: 6_000, learning_rate: 7e-4, warm_up_steps: 200, final_share: 0.05 },
        octree_depth: 7,
        scheduled_sampling: [0.0, 0.0],
        predicted_share: 0.4,
        sensor_share: 0.5,
        novel_rays: 6144,
        visible_rays: 2048,
    };

    /// Default fields of stage 3.
    pub const DEFAULT_JOINT: Self = Self {
        schedule: Schedule { steps: 4_000, learning_rate: 1e-4, ..Self::DEFAULT.schedule },
        scheduled_sampling: [0.5, 1.0],
        predicted_share: 0.5,
        ..Self::DEFAULT
    };
}

/// Former and present names of fields.
const RENAMED: [(&str, &str); 2] = [("rate", "learning_rate"), ("own_growth", "scheduled_sampling")];

/// Deserialises phases; fields that a table omits come from `defaults`.
///
/// (`serde(default)` takes no value of ours, and cannot be combined with `flatten`.)
fn with_defaults<'de, D: Deserializer<'de>, P: Serialize + DeserializeOwned>(
    deserializer: D,
    defaults: &P,
) -> Result<Vec<P>, D::Error> {
    let defaults = toml::Table::try_from(defaults).map_err(D::Error::custom)?;
    let tables = Vec::<toml::Table>::deserialize(deserializer)?;
    let phases = tables.into_iter().map(|mut table| {
        for (old, new) in RENAMED {
            if let Some(value) = table.remove(old)
                && table.insert(new.to_owned(), value).is_some()
            {
                return Err(D::Error::duplicate_field(new));
            }
        }
        if let Some(field) = table.keys().find(|field| !defaults.contains_key(*field)) {
            let known: Vec<String> = defaults.keys().map(|field| format!("`{field}`")).collect();
            return Err(D::Error::custom(format!("unknown field `{field}`, expected one of {}", known.join(", "))));
        }
        let mut phase = defaults.clone();
        phase.extend(table);
        phase.try_into().map_err(|error: toml::de::Error| D::Error::custom(error.message()))
    });
    phases.collect()
}

pub(crate) fn depth_phases<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Vec<DepthPhase>, D::Error> {
    with_defaults(deserializer, &DepthPhase::DEFAULT)
}

pub(crate) fn light_phases<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Vec<LightPhase>, D::Error> {
    with_defaults(deserializer, &LightPhase::DEFAULT)
}

pub(crate) fn joint_phases<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Vec<LightPhase>, D::Error> {
    with_defaults(deserializer, &LightPhase::DEFAULT_JOINT)
}

pub(crate) fn expected_phases<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Vec<ExpectedPhase>, D::Error> {
    with_defaults(deserializer, &ExpectedPhase::defaults())
}

/// A phase of any stage.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Phase {
    Depth(DepthPhase),
    Light(LightPhase),
    Joint(LightPhase),
    Expected(ExpectedPhase),
}

impl Phase {
    /// Numbers the phases of one stage.
    pub fn numbered(
        networks: TrainedNetworks,
        phases: impl ExactSizeIterator<Item = Self>,
    ) -> Vec<(TrainingPhase, Self)> {
        let of = phases.len();
        phases.enumerate().map(|(index, phase)| (TrainingPhase { networks, number: index + 1, of }, phase)).collect()
    }

    pub fn schedule(&self) -> &Schedule {
        match self {
            Self::Depth(phase) => &phase.schedule,
            Self::Light(phase) | Self::Joint(phase) => &phase.schedule,
            Self::Expected(phase) => &phase.schedule,
        }
    }

    pub fn steps(&self) -> u64 {
        self.schedule().steps
    }

    /// Returns the number of samples per step.
    pub fn batch_size(&self) -> usize {
        match self {
            Self::Depth(phase) => phase.batch_size,
            Self::Light(_) | Self::Joint(_) => 1,
            Self::Expected(phase) => phase.batch_size,
        }
    }

    /// Returns the depth of the octree; `None` for phases without one.
    pub fn octree_depth(&self) -> Option<u32> {
        match self {
            Self::Depth(_) | Self::Expected(_) => None,
            Self::Light(phase) | Self::Joint(phase) => Some(phase.octree_depth),
        }
    }
}

/// Interpolates a share linearly over the steps of a phase.
pub(crate) fn interpolated_share(ends: [f32; 2], step: u64, steps: u64) -> f32 {
    ends[0] + (ends[1] - ends[0]) * (step as f32 / steps.max(1) as f32)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn learning_rates_rise_and_fall() {
        let schedule = Schedule { steps: 110, learning_rate: 1e-3, warm_up_steps: 10, final_share: 0.2 };
        let close = |step, expected: f64| {
            let got = schedule.learning_rate_at(step);
            assert!((got - expected).abs() < 1e-12, "{step}: {got}");
        };
        close(0, 1e-4);
        close(9, 1e-3);
        close(10, 1e-3);
        // Half-way, the cosine gives the mean of 1 and the final share.
        close(60, 0.6e-3);
        close(110, 0.2e-3);
    }
}
