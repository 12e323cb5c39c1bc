use lo_completion::{ExpectedLightOptions, ObservedShading};
use lo_geometry::Vec3;
use lo_imaging::Photo;
use lo_scene::{Estimate, ExpectedLight, LightEffect};

use crate::LightingError;

/// Checks that a pixel of the photo can serve as white, for [`LightTuning::white`](lo_scene::LightTuning::white).
///
/// `pixel` is column and row in pixels of the photo.
///
/// # Errors
/// If the pixel is outside the photo, shows no surface, or is clipped or black.
pub fn check_white(estimate: &Estimate, pixel: [f64; 2]) -> Result<(), LightingError> {
    white_surface(estimate, pixel).map(|_| ())
}

/// Returns gains of red, green and blue that give inferred light the photo's colour at the white pixel; 1 without one.
pub(crate) fn white_tint(
    estimate: &Estimate,
    shading: &ObservedShading,
    white: Option<[f64; 2]>,
) -> Result<[f32; 3], LightingError> {
    match (expected_light(estimate), white) {
        (Some(expected), Some(white)) => tint_from_white(estimate, expected, shading, white),
        _ => Ok([1.0; 3]),
    }
}

/// Returns position and normal of the surface at a pixel, and its colour at luminance 1.
fn white_surface(estimate: &Estimate, [u, v]: [f64; 2]) -> Result<((Vec3, Vec3), [f32; 3]), LightingError> {
    let surface = lo_insert::surface_at_pixel(estimate, u, v).map_err(LightingError::White)?;
    Ok((surface, unit_luminance(colour_around(&estimate.frame.photo, [u, v])?)))
}

/// Fixed-point steps to the tint. Each removes most of the remaining error.
const WHITE_STEPS: usize = 4;

/// Largest gain of a channel, and inverse of the smallest.
const MAX_TINT: f32 = 4.0;

/// Finds the gains under which irradiance at the white pixel has the photo's colour.
fn tint_from_white(
    estimate: &Estimate,
    expected: &ExpectedLight,
    shading: &ObservedShading,
    white: [f64; 2],
) -> Result<[f32; 3], LightingError> {
    let (surface, shown) = white_surface(estimate, white)?;
    let mut tint = [1.0; 3];
    for _ in 0..WHITE_STEPS {
        let mut light = estimate.light.clone();
        lo_completion::apply_expected_light(
            &mut light,
            expected,
            shading,
            &ExpectedLightOptions { tint, ..ExpectedLightOptions::default() },
        );
        let irradiance = lo_completion::irradiance_at(&light, &[surface]).first().copied().unwrap_or(Vec3::ONE);
        let got = unit_luminance(irradiance.to_array());
        for c in 0..3 {
            tint[c] = (tint[c] * shown[c] / got[c].max(1e-3)).clamp(1.0 / MAX_TINT, MAX_TINT);
        }
    }
    Ok(tint)
}

/// Returns the mean linear colour of 5 × 5 pixels.
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

/// Returns expected light, if the estimate has it and it has an effect.
pub(crate) fn expected_light(estimate: &Estimate) -> Option<&ExpectedLight> {
    estimate.expected.as_ref().filter(|_| LightEffect::of(estimate) == LightEffect::Expected)
}

/// Scales a colour to luminance 1.
pub(crate) fn unit_luminance(colour: [f32; 3]) -> [f32; 3] {
    let luminance = lo_imaging::luminance(colour).max(1e-6);
    colour.map(|c| c / luminance)
}
