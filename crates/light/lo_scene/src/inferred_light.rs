use std::ops::RangeInclusive;

use serde::{Deserialize, Serialize};

use crate::{Completion, Estimate};

/// Valid factors on the contrast of plausible light, in stops.
pub const CONTRASTS: RangeInclusive<f32> = 0.0..=3.0;

/// Valid warmths: stops by which inferred light is redder than estimated.
pub const WARMTHS_EV: RangeInclusive<f32> = -4.0..=4.0;

/// Largest coordinate of a pixel in a photo of any size.
const MAX_PIXEL: f64 = (1u32 << 20) as f64;

/// Light that a scene is rendered with.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "typescript", derive(ts_rs::TS))]
#[serde(rename_all = "kebab-case")]
pub enum LightMode {
    /// The likeliest radiance, as in the scene file's octree. Lamps and windows of uncertain position vanish in it.
    Even,
    /// Expected light, spread over the possible positions of lamps and windows: right on average, but softer than
    /// real rooms.
    #[default]
    Expected,
    /// Expected light gathered into lamps and windows at their likeliest positions, as bright as the photo's shading
    /// implies. Meant for inserted objects: their shading and shadows are as contrasted as in real rooms.
    Plausible,
}

impl LightMode {
    /// Returns its name on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::Even => "even",
            Self::Expected => "expected",
            Self::Plausible => "plausible",
        }
    }
}

/// User's adjustments of inferred light.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "typescript", derive(ts_rs::TS), ts(optional_fields))]
#[serde(default)]
pub struct LightTuning {
    /// Factor on the contrast of plausible light, in stops; 1 is typical of such a room.
    pub contrast: f32,
    /// Stops by which red exceeds blue more than estimated, or than `white` gives; luminance is kept.
    pub warmth_ev: f32,
    /// Photo pixel that shows something white: inferred light gets the colour that white has there.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub white: Option<[f64; 2]>,
}

impl Default for LightTuning {
    /// Returns neutral tuning.
    fn default() -> Self {
        Self { contrast: 1.0, warmth_ev: 0.0, white: None }
    }
}

impl LightTuning {
    /// Returns the name of a value that is out of range. The white pixel is not checked against the photo's size.
    pub fn invalid_field(&self) -> Option<&'static str> {
        if !CONTRASTS.contains(&self.contrast) {
            return Some("the contrast");
        }
        if !WARMTHS_EV.contains(&self.warmth_ev) {
            return Some("the warmth");
        }
        let is_pixel = |pixel: [f64; 2]| pixel.iter().all(|at| (0.0..=MAX_PIXEL).contains(at));
        self.white.is_some_and(|pixel| !is_pixel(pixel)).then_some("the white pixel")
    }
}

/// User's choice of the light that a scene is rendered with.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "typescript", derive(ts_rs::TS))]
pub struct InferredLight {
    /// The light.
    pub light: LightMode,
    /// Its tuning. Values without effect on `light` are kept for when another light is chosen.
    #[serde(flatten)]
    pub tuning: LightTuning,
}

impl Default for InferredLight {
    /// Returns plausible light, the default for inserted objects.
    fn default() -> Self {
        Self { light: LightMode::Plausible, tuning: LightTuning::default() }
    }
}

impl InferredLight {
    /// Returns a copy in which tuning without effect on this light is reset.
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

/// Effect of the choice of light on a scene.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[cfg_attr(feature = "typescript", derive(ts_rs::TS))]
#[serde(rename_all = "kebab-case")]
pub enum LightEffect {
    /// None: no network completed the scene, whose shell has its own lamp, or an HDR panorama with its lamps was
    /// applied.
    None,
    /// Plausible light has fitted lamps. There is no expected light, or a panorama replaced it: expected light equals
    /// even light, and tuning has no effect.
    Fitted,
    /// All lights differ, and tuning changes them.
    Expected,
}

impl LightEffect {
    /// Returns the effect for an estimate.
    pub fn of(estimate: &Estimate) -> Self {
        let knows_lamps = estimate.panorama.as_ref().is_some_and(|contribution| !contribution.source.clipped);
        if estimate.origin.completion != Completion::Network || knows_lamps {
            Self::None
        } else if estimate.expected.is_none() || estimate.panorama.is_some() {
            Self::Fitted
        } else {
            Self::Expected
        }
    }
}
