use lo_completion::{ExpectedLightOptions, ExpectedLightReport, InitialLamps, LampFit, ObservedShading};
use lo_geometry::Vec3;
use lo_imaging::Photo;
use lo_insert::InsertError;
use lo_lights::LightsError;
use lo_octree::LightOctree;
use lo_scene::{ExpectedLight, GuessedLight, LightEffect, LightMode, LightTuning, Scene};

/// What lighting a scene made of what was guessed.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct LightReport {
    /// Lamps and windows that expected light was gathered into.
    pub laid: ExpectedLightReport,
    /// How bright these and others are by the photo's shading.
    pub fit: LampFit,
}

/// Why a scene cannot be lit as asked for.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum LightingError {
    /// An edit is of an emitter that there is not.
    #[error(transparent)]
    Edit(#[from] LightsError),
    /// The white pixel shows no surface.
    #[error("what is said to be white: {0}")]
    White(#[source] InsertError),
    /// The white pixel is clipped or black, so it has no colour.
    #[error("what is said to be white is {0} at ({1}, {2}): choose a pixel of another brightness")]
    WhiteWithoutColour(&'static str, f64, f64),
}

/// Whether a pixel of a scene's photo can be said to be white.
///
/// # Errors
/// Where it lies outside of the photo, shows no surface, or is clipped or black.
pub fn check_white(scene: &Scene, pixel: [f64; 2]) -> Result<(), LightingError> {
    white_surface(scene, pixel).map(|_| ())
}

/// Gives a scene's octree the light of `mode`, as far as that has an effect ([`LightEffect`]).
///
/// A clipped panorama does not know how bright lamps are: plausible light has these fitted.
pub(crate) fn lay_light(
    scene: &mut Scene,
    mode: LightMode,
    tuning: &LightTuning,
) -> Result<LightReport, LightingError> {
    let guessed = GuessedLight { light: mode, tuning: *tuning };
    if !is_laid(scene, &guessed) {
        return Ok(LightReport::default());
    }
    let seen = seen_of(scene);
    let white = white_tint(scene, &seen, tuning.white)?;
    let (light, report) = laid(scene, &seen, &guessed, white, false);
    scene.light = light;
    Ok(report)
}

/// Why light as estimated can be laid.
pub(crate) const NOTHING_WRONG: &str = "nothing is asked for that could be wrong";

/// [`lay_light`] as estimated.
pub(crate) fn lay_usual(scene: &mut Scene, mode: LightMode) -> LightReport {
    lay_light(scene, mode, &LightTuning::default()).expect(NOTHING_WRONG)
}

/// Whether this light differs from what the scene's octree holds.
pub(crate) fn is_laid(scene: &Scene, guessed: &GuessedLight) -> bool {
    guessed.light != LightMode::Even && LightEffect::of(scene) != LightEffect::None
}

/// What light is laid by.
pub(crate) fn seen_of(scene: &Scene) -> ObservedShading {
    ObservedShading::new(scene.frame.working().without_flying_pixels(), scene.up())
}

/// Expected light, where it counts.
fn expected(scene: &Scene) -> Option<&ExpectedLight> {
    scene.expected.as_ref().filter(|_| LightEffect::of(scene) == LightEffect::Expected)
}

/// The scene's octree in a light that [is laid](is_laid). `white` as of [`white_tint`].
pub(crate) fn laid(
    scene: &Scene,
    seen: &ObservedShading,
    guessed: &GuessedLight,
    white: [f32; 3],
    is_preview: bool,
) -> (LightOctree, LightReport) {
    let (mut light, mut report) = (scene.light.clone(), LightReport::default());
    let expected = expected(scene);
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

/// Gains of guessed light by channel under which it has the photo's colour at a pixel that is said to be white; 1
/// without one.
pub(crate) fn white_tint(
    scene: &Scene,
    seen: &ObservedShading,
    white: Option<[f64; 2]>,
) -> Result<[f32; 3], LightingError> {
    match (expected(scene), white) {
        (Some(expected), Some(white)) => tint_of_white(scene, expected, seen, white),
        _ => Ok([1.0; 3]),
    }
}

/// Gains of red, green and blue that leave the luminance of white.
fn warmth_tint(warmth_ev: f32) -> [f32; 3] {
    hue([0.5 * warmth_ev, 0.0, -0.5 * warmth_ev].map(f32::exp2))
}

/// A colour of luminance 1.
fn hue(colour: [f32; 3]) -> [f32; 3] {
    let level = lo_imaging::luminance(colour).max(1e-6);
    colour.map(|c| c / level)
}

/// The surface that a pixel shows, and its colour, of luminance 1.
fn white_surface(scene: &Scene, [u, v]: [f64; 2]) -> Result<((Vec3, Vec3), [f32; 3]), LightingError> {
    let place = lo_insert::surface_at_pixel(scene, u, v).map_err(LightingError::White)?;
    Ok((place, hue(colour_around(&scene.frame.photo, [u, v])?)))
}

/// Fixed-point steps to the tint of what is white: each takes away most of the rest.
const WHITE_STEPS: usize = 4;

/// Most that a channel's gain changes by for what is white.
const MAX_TINT: f32 = 4.0;

/// Gains under which light has the colour of the photo where that shows something white.
fn tint_of_white(
    scene: &Scene,
    expected: &ExpectedLight,
    seen: &ObservedShading,
    white: [f64; 2],
) -> Result<[f32; 3], LightingError> {
    let (place, shown) = white_surface(scene, white)?;
    let mut tint = [1.0; 3];
    for _ in 0..WHITE_STEPS {
        let mut light = scene.light.clone();
        lo_completion::apply_expected_light(
            &mut light,
            expected,
            seen,
            &ExpectedLightOptions { tint, ..ExpectedLightOptions::default() },
        );
        let irradiance = lo_completion::irradiance_at(&light, &[place]).first().copied().unwrap_or(Vec3::ONE);
        let got = hue(irradiance.to_array());
        for c in 0..3 {
            tint[c] = (tint[c] * shown[c] / got[c].max(1e-3)).clamp(1.0 / MAX_TINT, MAX_TINT);
        }
    }
    Ok(tint)
}

/// Mean linear colour of 5 × 5 pixels.
fn colour_around(photo: &Photo, [u, v]: [f64; 2]) -> Result<[f32; 3], LightingError> {
    const AROUND: usize = 2;
    let (width, height) = (photo.width(), photo.height());
    let span = |at: f64, size: usize| (at as usize).saturating_sub(AROUND)..(at as usize + AROUND + 1).min(size);
    let (mut sum, mut count) = ([0.0f32; 3], 0.0f32);
    for (x, y) in span(v, height).flat_map(|y| span(u, width).map(move |x| (x, y))) {
        let rgb = photo.linear_at((x, y));
        (0..3).for_each(|c| sum[c] += rgb[c]);
        count += 1.0;
    }
    let mean = sum.map(|c| c / count.max(1.0));
    match mean {
        _ if mean.iter().any(|&c| c > 0.95) => Err(LightingError::WhiteWithoutColour("clipped", u, v)),
        _ if mean.iter().any(|&c| c < 0.005) => Err(LightingError::WhiteWithoutColour("black", u, v)),
        mean => Ok(mean),
    }
}

/// Gives a scene's octree plausible light ([`LightMode::Plausible`]).
pub fn fit_lamps(scene: &mut Scene) -> LampFit {
    lay_usual(scene, LightMode::Plausible).fit
}
