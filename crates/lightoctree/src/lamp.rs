use lo_completion::{LaidExpectation, LampFit, LampGuess, LayExpected};
use lo_geometry::Vec3;
use lo_imaging::Photo;
use lo_insert::InsertError;
use lo_lights::LightsError;
use lo_scene::{Completion, ExpectedLight, Frame, Scene};

/// Which light a scene is lit by.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum LightMode {
    /// The likeliest radiance, in which lamps and windows of uncertain place vanish: what the scene file's octree holds.
    Even,
    /// The expected energy, spread over where lamps and windows may be: right on average, and softer than rooms are.
    #[default]
    Expected,
    /// The expected energy gathered into lamps and windows where they are likeliest, as bright as the photo's shading asks for: for objects, whose lit and
    /// dark sides and shadows are then those of rooms.
    Plausible,
}

/// How guessed light differs from what is estimated.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LightTuning {
    /// Factor on the contrast of plausible light, in stops; 1 is what rooms like this one have.
    pub contrast: f32,
    /// Stops by which red exceeds blue more than is estimated; luminance stays.
    pub warmth_ev: f32,
    /// A pixel of the photo that shows something white: guessed light gets the colour that it has there.
    pub white: Option<[f64; 2]>,
}

impl Default for LightTuning {
    /// As estimated.
    fn default() -> Self {
        Self { contrast: 1.0, warmth_ev: 0.0, white: None }
    }
}

impl LightTuning {
    /// Gains of red, green and blue that leave the luminance of white.
    fn tint(&self) -> [f32; 3] {
        hue([0.5 * self.warmth_ev, 0.0, -0.5 * self.warmth_ev].map(f32::exp2))
    }
}

/// A colour of luminance 1.
fn hue(colour: [f32; 3]) -> [f32; 3] {
    let level = lo_imaging::luminance(colour).max(1e-6);
    colour.map(|c| c / level)
}

/// What lighting a scene made of what was guessed.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct LightReport {
    /// Lamps and windows that expected light was gathered into.
    pub laid: LaidExpectation,
    /// How bright these and others are by the photo's shading.
    pub fit: LampFit,
}

/// Gives a scene's octree the light of `mode`.
///
/// Scenes that no network completed stay as they are: the shell has a lamp of its own. So do those onto which an HDR panorama was laid: it knows the lamps.
/// A clipped one does not know how bright they are: plausible light has these fitted. Where no network expects light, plausible light has what was guessed
/// of lamps fitted, and expected light is even.
pub(crate) fn lay_light(
    scene: &mut Scene,
    mode: LightMode,
    tuning: &LightTuning,
) -> Result<LightReport, LightingError> {
    let knows_lamps = scene.panorama.as_ref().is_some_and(|laid| !laid.source.clipped);
    if mode == LightMode::Even || scene.completion != Completion::Network || knows_lamps {
        return Ok(LightReport::default());
    }
    let (seen, up) = (scene.frame.working().without_flying_pixels(), scene.up());
    let mut report = LightReport::default();
    let expected = scene.expected.as_ref().filter(|_| scene.panorama.is_none());
    if let Some(expected) = expected {
        let contrast = (mode == LightMode::Plausible).then_some(tuning.contrast);
        let mut how = LayExpected { contrast, tint: tuning.tint() };
        if let Some(white) = tuning.white {
            how.tint = tint_of_white(scene, expected, &seen, &how, white)?;
        }
        report.laid = lo_completion::lay_expected(&mut scene.light, expected, &seen, up, &how);
    }
    if mode == LightMode::Plausible {
        let guess = if expected.is_some() { LampGuess::Expected } else { LampGuess::Averaged };
        report.fit = lo_completion::fit_lamps(&mut scene.light, &seen, up, guess);
    }
    Ok(report)
}

/// [`lay_light`] as estimated.
pub(crate) fn lay_usual(scene: &mut Scene, mode: LightMode) -> LightReport {
    lay_light(scene, mode, &LightTuning::default()).expect("nothing is asked for that could be wrong")
}

/// Why a scene cannot be lit as asked for.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum LightingError {
    /// An edit is of an emitter that there is not.
    #[error(transparent)]
    Edit(#[from] LightsError),
    /// What is said to be white shows no surface.
    #[error("what is said to be white: {0}")]
    White(#[source] InsertError),
    /// What is said to be white is clipped or black, and has no colour.
    #[error("what is said to be white is {0} at ({1}, {2}): choose a pixel of another brightness")]
    WhiteWithoutColour(&'static str, f64, f64),
}

/// Fixed-point steps to the tint of what is white: each takes away most of the rest.
const WHITE_STEPS: usize = 4;

/// Most that a channel's gain changes by for what is white.
const MAX_TINT: f32 = 4.0;

/// Gains under which light has the colour of the photo where that shows something white.
fn tint_of_white(
    scene: &Scene,
    expected: &ExpectedLight,
    seen: &Frame,
    how: &LayExpected,
    [u, v]: [f64; 2],
) -> Result<[f32; 3], LightingError> {
    let place = lo_insert::surface_at_pixel(scene, u, v).map_err(LightingError::White)?;
    let shown = hue(colour_around(&scene.frame.photo, [u, v])?);
    let mut tint = how.tint;
    for _ in 0..WHITE_STEPS {
        let mut light = scene.light.clone();
        lo_completion::lay_expected(&mut light, expected, seen, scene.up(), &LayExpected { tint, contrast: None });
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
