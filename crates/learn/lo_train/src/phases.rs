//! The phases of a run: how long, how fast, on what.

use crate::augmentation::AugmentationConfig;
use crate::config::PanoramaData;
use lo_events::{TrainedNetworks, TrainingPhase};
use serde::de::{DeserializeOwned, Error};
use serde::{Deserialize, Deserializer, Serialize};

/// Steps and learning rate of a phase.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Schedule {
    /// Steps.
    pub steps: u64,
    /// Greatest learning rate.
    pub learning_rate: f64,
    /// Steps in which the learning rate rises to it.
    pub warm_up_steps: u64,
    /// Share of the learning rate that is left at the end, after a half cosine.
    pub final_share: f64,
}

impl Schedule {
    /// Learning rate of a step: a line up to the greatest, then half a cosine down to its final share.
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

/// A part of stage 1. In a file its schedule stands beside the other fields.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DepthPhase {
    /// Steps and learning rate.
    #[serde(flatten)]
    pub schedule: Schedule,
    /// Photos a step, all of one size. More than one are faster than as many steps, and normalised together.
    pub batch_size: usize,
    /// Width of the photos in pixels, of upright ones the height; smaller ones are faster.
    pub photo_width: usize,
    /// Normalise by the running statistics, as in use, instead of those of the photos at hand.
    pub frozen_statistics: bool,
    /// Learning rate of the encoder as a share of the others': what real pictures taught it is forgotten the more slowly.
    pub encoder_lr_ratio: f32,
    /// Trains what tells depth and camera alone. Encoder, `f_L` and single map stay as they are, and with them a light network that was trained on them.
    pub decoder_only: bool,
}

/// A part of stage 2 or 3; each step is of one photo. In a file its schedule stands beside the other fields.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LightPhase {
    /// Steps and learning rate.
    #[serde(flatten)]
    pub schedule: Schedule,
    /// Depth of the octree.
    pub octree_depth: u32,
    /// Share of the steps whose octree grows by the network's own predictions, at the beginning and at the end.
    pub scheduled_sampling: [f32; 2],
    /// Share of the samples whose depth the depth network predicts. In stage 2 that stays as it is.
    pub predicted_share: f32,
    /// Share of the others that come with a sensor's depth instead of the true one.
    pub sensor_share: f32,
    /// Rays of novel views a step.
    pub novel_rays: usize,
    /// Rays of the photo a step.
    pub visible_rays: usize,
}

/// The training of expected light. In a file its schedule stands beside the other fields.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ExpectedPhase {
    /// Steps and learning rate.
    #[serde(flatten)]
    pub schedule: Schedule,
    /// Photos a step.
    pub batch_size: usize,
    /// Photos that the steps are drawn from. They are made once, with the depth network's depth.
    pub photos: usize,
    /// Panoramas that they are cut out of; where there are none, those of the run, or all of its data.
    pub panoramas: Vec<PanoramaData>,
    /// Augmentation of these photos.
    pub augmentation: AugmentationConfig,
}

impl ExpectedPhase {
    /// Defaults; focal lengths are not varied.
    pub fn usual() -> Self {
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
    /// What a file need not say.
    pub const USUAL: Self = Self {
        schedule: Schedule { steps: 6_000, learning_rate: 1e-3, warm_up_steps: 200, final_share: 0.05 },
        batch_size: 16,
        photo_width: 240,
        frozen_statistics: false,
        encoder_lr_ratio: 1.0,
        decoder_only: false,
    };
}

impl LightPhase {
    /// What a file need not say of stage 2.
    pub const USUAL: Self = Self {
        schedule: Schedule { steps: 6_000, learning_rate: 7e-4, warm_up_steps: 200, final_share: 0.05 },
        octree_depth: 7,
        scheduled_sampling: [0.0, 0.0],
        predicted_share: 0.4,
        sensor_share: 0.5,
        novel_rays: 6144,
        visible_rays: 2048,
    };

    /// What a file need not say of stage 3.
    pub const USUAL_JOINT: Self = Self {
        schedule: Schedule { steps: 4_000, learning_rate: 1e-4, ..Self::USUAL.schedule },
        scheduled_sampling: [0.5, 1.0],
        predicted_share: 0.5,
        ..Self::USUAL
    };
}

/// Names that fields had, and those that they have.
const RENAMED: [(&str, &str); 2] = [("rate", "learning_rate"), ("own_growth", "scheduled_sampling")];

/// Phases of which each table names what differs from `usual`. (`serde(default)` cannot be told which defaults, nor be combined with `flatten`.)
fn differing<'de, D: Deserializer<'de>, P: Serialize + DeserializeOwned>(
    deserializer: D,
    usual: &P,
) -> Result<Vec<P>, D::Error> {
    let usual = toml::Table::try_from(usual).map_err(D::Error::custom)?;
    let tables = Vec::<toml::Table>::deserialize(deserializer)?;
    let phases = tables.into_iter().map(|mut table| {
        for (old, new) in RENAMED {
            if let Some(value) = table.remove(old)
                && table.insert(new.to_owned(), value).is_some()
            {
                return Err(D::Error::duplicate_field(new));
            }
        }
        if let Some(field) = table.keys().find(|field| !usual.contains_key(*field)) {
            let known: Vec<String> = usual.keys().map(|field| format!("`{field}`")).collect();
            return Err(D::Error::custom(format!("unknown field `{field}`, expected one of {}", known.join(", "))));
        }
        let mut phase = usual.clone();
        phase.extend(table);
        phase.try_into().map_err(|error: toml::de::Error| D::Error::custom(error.message()))
    });
    phases.collect()
}

pub(crate) fn depth_phases<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Vec<DepthPhase>, D::Error> {
    differing(deserializer, &DepthPhase::USUAL)
}

pub(crate) fn light_phases<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Vec<LightPhase>, D::Error> {
    differing(deserializer, &LightPhase::USUAL)
}

pub(crate) fn joint_phases<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Vec<LightPhase>, D::Error> {
    differing(deserializer, &LightPhase::USUAL_JOINT)
}

pub(crate) fn expected_phases<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Vec<ExpectedPhase>, D::Error> {
    differing(deserializer, &ExpectedPhase::usual())
}

/// A part of a run, of whichever stage.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Phase {
    Depth(DepthPhase),
    Light(LightPhase),
    Joint(LightPhase),
    Expected(ExpectedPhase),
}

impl Phase {
    /// `phases` of one stage with their places among each other.
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

    /// Samples of a step.
    pub fn batch_size(&self) -> usize {
        match self {
            Self::Depth(phase) => phase.batch_size,
            Self::Light(_) | Self::Joint(_) => 1,
            Self::Expected(phase) => phase.batch_size,
        }
    }

    /// Depth of the octree, where there is one.
    pub fn octree_depth(&self) -> Option<u32> {
        match self {
            Self::Depth(_) | Self::Expected(_) => None,
            Self::Light(phase) | Self::Joint(phase) => Some(phase.octree_depth),
        }
    }
}

/// A share that goes from one value to another over a phase.
pub(crate) fn between(ends: [f32; 2], step: u64, steps: u64) -> f32 {
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
        // Half of the cosine is the middle between 1 and the final share.
        close(60, 0.6e-3);
        close(110, 0.2e-3);
    }
}
