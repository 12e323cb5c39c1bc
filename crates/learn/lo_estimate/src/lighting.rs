use std::borrow::Cow;
use std::sync::Arc;

use lo_completion::{ExpectedLightOptions, ExpectedLightReport, InitialLamps, LampFit, ObservedShading};
use lo_geometry::Vec3;
use lo_lights::{Emitter, emitters, remove_emitters};
use lo_octree::LightOctree;
use lo_scene::{Estimate, InferredLight, LightEffect, LightMode, LitScene};

use crate::LightingError;
use crate::white::{expected_light, unit_luminance, white_tint};

/// How a choice of light changed an estimate's inferred light.
///
/// The default value means no change.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct LightReport {
    /// Lamps and windows into which expected light was gathered, and the resulting contrast.
    pub expected: ExpectedLightReport,
    /// Factors on lamps and surfaces, fitted to the photo's shading.
    pub fit: LampFit,
}

/// Reason why light chosen without a white pixel cannot fail.
pub(crate) const NO_WHITE_PIXEL: &str = "light without a white pixel cannot fail";

/// Lights an estimate by a choice of light, without edits of lights.
///
/// The result has even light if the choice has no effect on the estimate
/// ([`LightEffect::None`](lo_scene::LightEffect::None)). If a clipped panorama was applied to the estimate, plausible
/// light fits its lamps, because a clipped panorama does not show how bright they are.
///
/// # Errors
/// If the white pixel shows no surface, or is clipped or black.
pub fn apply_light(estimate: &Arc<Estimate>, choice: &InferredLight) -> Result<(LitScene, LightReport), LightingError> {
    if !differs_from_even(estimate, choice) {
        return Ok((LitScene::as_estimated(estimate.clone()), LightReport::default()));
    }
    let shading = observed_shading(estimate);
    let white = white_tint(estimate, &shading, choice.tuning.white)?;
    let (light, report) = apply_choice(estimate, &shading, choice, white, false);
    Ok((LitScene { estimate: estimate.clone(), light, edited: None }, report))
}

/// Lights an estimate by plausible light without tuning.
///
/// The names of emitters refer to this light, whichever light is chosen.
pub fn plausible_light(estimate: &Arc<Estimate>) -> (LitScene, LightReport) {
    apply_light(estimate, &InferredLight::default()).expect(NO_WHITE_PIXEL)
}

/// Returns the scene with reflected light only: the estimate's even light without its emitters.
///
/// The user's edits have no influence.
pub fn indirect_only(estimate: &Arc<Estimate>) -> LitScene {
    let found: Vec<Emitter> = emitters(&plausible_light(estimate).0);
    let mut scene = LitScene::as_estimated(estimate.clone());
    remove_emitters(&mut scene, &found);
    scene
}

/// Returns the estimate with the radiance that its nodes send towards `at_m`, in metres.
///
/// This concerns directional radiance (variant "SG" of the paper). An isotropic estimate is returned unchanged.
pub fn for_viewpoint(estimate: &Arc<Estimate>, at_m: Vec3) -> Arc<Estimate> {
    match estimate.light.seen_from(at_m) {
        Cow::Borrowed(_) => estimate.clone(),
        Cow::Owned(light) => Arc::new(Estimate { light, ..Estimate::clone(estimate) }),
    }
}

/// Returns whether a choice of light can differ from the estimate's even light.
pub(crate) fn differs_from_even(estimate: &Estimate, choice: &InferredLight) -> bool {
    choice.light != LightMode::Even && LightEffect::of(estimate) != LightEffect::None
}

/// Extracts the photo's shading, to which inferred light is fitted.
pub(crate) fn observed_shading(estimate: &Estimate) -> ObservedShading {
    ObservedShading::new(estimate.surface().clone(), estimate.surface_normals(), estimate.up())
}

/// Returns the octree in a light that [differs from even light](differs_from_even). `white` is from [`white_tint`].
pub(crate) fn apply_choice(
    estimate: &Estimate,
    shading: &ObservedShading,
    choice: &InferredLight,
    white: [f32; 3],
    is_preview: bool,
) -> (LightOctree, LightReport) {
    let (mut light, mut report) = (estimate.light.clone(), LightReport::default());
    let expected = expected_light(estimate);
    let is_plausible = choice.light == LightMode::Plausible;
    if let Some(expected) = expected {
        let warmth = warmth_tint(choice.tuning.warmth_ev);
        let tint = std::array::from_fn(|c| white[c] * warmth[c]);
        let contrast = is_plausible.then_some(choice.tuning.contrast);
        let options = ExpectedLightOptions { contrast, tint, is_preview };
        report.expected = lo_completion::apply_expected_light(&mut light, expected, shading, &options);
    }
    if is_plausible {
        let initial = if expected.is_some() { InitialLamps::Expected } else { InitialLamps::Averaged };
        let fit = if is_preview { lo_completion::preview_lamps } else { lo_completion::fit_lamps };
        report.fit = fit(&mut light, shading, initial);
    }
    (light, report)
}

/// Returns gains of red, green and blue that keep the luminance of white.
fn warmth_tint(warmth_ev: f32) -> [f32; 3] {
    unit_luminance([0.5 * warmth_ev, 0.0, -0.5 * warmth_ev].map(f32::exp2))
}
