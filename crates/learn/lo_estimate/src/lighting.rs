use std::borrow::Cow;
use std::sync::Arc;

use lo_completion::{ExpectedLightOptions, ExpectedLightReport, InitialLamps, LampFit, ObservedShading};
use lo_geometry::Vec3;
use lo_insert::InsertError;
use lo_lights::{Emitter, LightsError, emitters, remove_emitters};
use lo_octree::LightOctree;
use lo_scene::{Estimate, ExpectedLight, GuessedLight, LightEffect, LightMode, LitScene};

use crate::white::white_tint;

/// How lighting an estimate changed its inferred light.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct LightReport {
    /// Lamps and windows that expected light was gathered into.
    pub laid: ExpectedLightReport,
    /// How bright these and others are by the photo's shading.
    pub fit: LampFit,
}

/// Why an estimate cannot be lit as requested.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum LightingError {
    /// An edit refers to an emitter that does not exist.
    #[error(transparent)]
    Edit(#[from] LightsError),
    /// The white pixel shows no surface.
    #[error("the white pixel: {0}")]
    White(#[source] InsertError),
    /// The white pixel is clipped or black, so it has no colour.
    #[error("the white pixel ({1}, {2}) is {0}: choose a pixel of another brightness")]
    WhiteWithoutColour(&'static str, f64, f64),
}

/// Light chosen without a white pixel cannot fail.
pub(crate) const NO_WHITE_PIXEL: &str = "light without a white pixel cannot fail";

/// An estimate in this light, before edits of lights.
///
/// A clipped panorama does not know how bright lamps are: plausible light has these fitted.
///
/// # Errors
/// A white pixel without a colour.
pub fn lit_by(estimate: &Arc<Estimate>, guessed: &GuessedLight) -> Result<(LitScene, LightReport), LightingError> {
    if !is_laid(estimate, guessed) {
        return Ok((LitScene::as_estimated(estimate.clone()), LightReport::default()));
    }
    let seen = shading_of(estimate);
    let white = white_tint(estimate, &seen, guessed.tuning.white)?;
    let (light, report) = laid(estimate, &seen, guessed, white, false);
    Ok((LitScene { estimate: estimate.clone(), light, edited: None }, report))
}

/// Plausible light as estimated: emitters are named in it.
pub fn plausible(estimate: &Arc<Estimate>) -> (LitScene, LightReport) {
    lit_by(estimate, &GuessedLight::default()).expect(NO_WHITE_PIXEL)
}

/// Light that surfaces reflect, without the estimate's emitters. The user's edits do not count.
pub fn indirect_only(estimate: &Arc<Estimate>) -> LitScene {
    let found: Vec<Emitter> = emitters(&plausible(estimate).0);
    let mut scene = LitScene::as_estimated(estimate.clone());
    remove_emitters(&mut scene, &found);
    scene
}

/// The estimate with the radiance that nodes send to a point, where it differs by direction (variant "SG" of the paper).
pub fn seen_from(estimate: &Arc<Estimate>, at_m: Vec3) -> Arc<Estimate> {
    match estimate.light.seen_from(at_m) {
        Cow::Borrowed(_) => estimate.clone(),
        Cow::Owned(light) => Arc::new(Estimate { light, ..Estimate::clone(estimate) }),
    }
}

/// Whether this light differs from the estimate's even light.
pub(crate) fn is_laid(estimate: &Estimate, guessed: &GuessedLight) -> bool {
    guessed.light != LightMode::Even && LightEffect::of(estimate) != LightEffect::None
}

/// The photo's shading, by which inferred light is fitted.
pub(crate) fn shading_of(estimate: &Estimate) -> ObservedShading {
    ObservedShading::new(estimate.surface().clone(), estimate.up())
}

/// Expected light, where it has an effect.
pub(crate) fn expected(estimate: &Estimate) -> Option<&ExpectedLight> {
    estimate.expected.as_ref().filter(|_| LightEffect::of(estimate) == LightEffect::Expected)
}

/// The octree in a light that [is laid](is_laid). `white` as of [`white_tint`].
pub(crate) fn laid(
    estimate: &Estimate,
    seen: &ObservedShading,
    guessed: &GuessedLight,
    white: [f32; 3],
    is_preview: bool,
) -> (LightOctree, LightReport) {
    let (mut light, mut report) = (estimate.light.clone(), LightReport::default());
    let expected = expected(estimate);
    let is_plausible = guessed.light == LightMode::Plausible;
    if let Some(expected) = expected {
        let warmth = warmth_tint(guessed.tuning.warmth_ev);
        let tint = std::array::from_fn(|c| white[c] * warmth[c]);
        let how = ExpectedLightOptions { contrast: is_plausible.then_some(guessed.tuning.contrast), tint, is_preview };
        report.laid = lo_completion::apply_expected_light(&mut light, expected, seen, &how);
    }
    if is_plausible {
        let guess = if expected.is_some() { InitialLamps::Expected } else { InitialLamps::Averaged };
        let fit = if is_preview { lo_completion::preview_lamps } else { lo_completion::fit_lamps };
        report.fit = fit(&mut light, seen, guess);
    }
    (light, report)
}

/// Gains of red, green and blue that leave the luminance of white.
fn warmth_tint(warmth_ev: f32) -> [f32; 3] {
    hue([0.5 * warmth_ev, 0.0, -0.5 * warmth_ev].map(f32::exp2))
}

/// A colour of luminance 1.
pub(crate) fn hue(colour: [f32; 3]) -> [f32; 3] {
    let level = lo_imaging::luminance(colour).max(1e-6);
    colour.map(|c| c / level)
}
