use std::ops::RangeInclusive;

use serde::{Deserialize, Serialize};

use crate::{Completion, Estimate};

/// Factors on the contrast of plausible light, in stops.
pub const CONTRASTS: RangeInclusive<f32> = 0.0..=3.0;

/// Stops by which guessed light is redder than estimated.
pub const WARMTHS_EV: RangeInclusive<f32> = -4.0..=4.0;

/// Which light a scene is lit by.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum LightMode {
    /// The likeliest radiance, in which lamps and windows of uncertain place vanish: what the scene file's octree
    /// holds.
    Even,
    /// The expected energy, spread over where lamps and windows may be: right on average, and softer than rooms are.
    #[default]
    Expected,
    /// The expected energy gathered into lamps and windows where they are likeliest, as bright as the photo's shading
    /// asks for: for objects, whose lit and dark sides and shadows are then those of rooms.
    Plausible,
}

impl LightMode {
    /// Its name, as on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::Even => "even",
            Self::Expected => "expected",
            Self::Plausible => "plausible",
        }
    }
}

/// How guessed light differs from what is estimated.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct LightTuning {
    /// Factor on the contrast of plausible light, in stops; 1 is what rooms like this one have.
    pub contrast: f32,
    /// Stops by which red exceeds blue more than is estimated, or than `white` gives; luminance stays.
    pub warmth_ev: f32,
    /// A pixel of the photo that shows something white: guessed light gets the colour that it has there.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub white: Option<[f64; 2]>,
}

impl Default for LightTuning {
    /// As estimated.
    fn default() -> Self {
        Self { contrast: 1.0, warmth_ev: 0.0, white: None }
    }
}

impl LightTuning {
    /// Names a value that is out of range. The white pixel is not compared with the size of a photo.
    pub fn wrong(&self) -> Option<&'static str> {
        if !CONTRASTS.contains(&self.contrast) {
            return Some("the contrast");
        }
        if !WARMTHS_EV.contains(&self.warmth_ev) {
            return Some("the warmth");
        }
        self.white.is_some_and(|pixel| !pixel.iter().all(|at| at.is_finite())).then_some("the white pixel")
    }
}

/// A choice of the light that a scene is lit by.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct GuessedLight {
    /// Which one.
    pub light: LightMode,
    /// How it is tuned. What has no effect on `light` is kept for another one.
    #[serde(flatten)]
    pub tuning: LightTuning,
}

impl Default for GuessedLight {
    /// Plausible light, the default for inserted objects.
    fn default() -> Self {
        Self { light: LightMode::Plausible, tuning: LightTuning::default() }
    }
}

impl GuessedLight {
    /// A copy in which tuning without effect on this light is reset.
    #[must_use]
    pub fn in_effect(&self) -> Self {
        let usual = LightTuning::default();
        let tuning = match self.light {
            LightMode::Even => usual,
            LightMode::Expected => LightTuning { contrast: usual.contrast, ..self.tuning },
            LightMode::Plausible => self.tuning,
        };
        Self { tuning, ..*self }
    }
}

/// Effect that the choice of light has in a scene.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum LightEffect {
    /// Nothing: no network completed the scene, whose shell has a lamp of its own, or an HDR panorama, which knows the
    /// lamps, was laid onto it.
    None,
    /// Plausible light has lamps fitted. No network expects light, or a panorama took its place: expected light is
    /// even, and tuning has no effect.
    Fitted,
    /// Each light differs, and tuning changes it.
    Expected,
}

impl LightEffect {
    /// The effect on this estimate.
    pub fn of(estimate: &Estimate) -> Self {
        let knows_lamps = estimate.panorama.as_ref().is_some_and(|laid| !laid.source.clipped);
        if estimate.origin.completion != Completion::Network || knows_lamps {
            Self::None
        } else if estimate.expected.is_none() || estimate.panorama.is_some() {
            Self::Fitted
        } else {
            Self::Expected
        }
    }
}
