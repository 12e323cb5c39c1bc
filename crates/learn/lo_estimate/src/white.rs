use lo_completion::{ExpectedLightOptions, ObservedShading};
use lo_geometry::Vec3;
use lo_imaging::Photo;
use lo_scene::{Estimate, ExpectedLight};

use crate::LightingError;
use crate::lighting::{expected, hue};

/// Checks that a pixel of the photo can serve as white.
///
/// # Errors
/// Where it lies outside of the photo, shows no surface, or is clipped or black.
pub fn check_white(estimate: &Estimate, pixel: [f64; 2]) -> Result<(), LightingError> {
    white_surface(estimate, pixel).map(|_| ())
}

/// Gains by channel that give inferred light the photo's colour at the white pixel; 1 without one.
pub(crate) fn white_tint(
    estimate: &Estimate,
    seen: &ObservedShading,
    white: Option<[f64; 2]>,
) -> Result<[f32; 3], LightingError> {
    match (expected(estimate), white) {
        (Some(expected), Some(white)) => tint_of_white(estimate, expected, seen, white),
        _ => Ok([1.0; 3]),
    }
}

/// The surface that a pixel shows, and its colour, of luminance 1.
fn white_surface(estimate: &Estimate, [u, v]: [f64; 2]) -> Result<((Vec3, Vec3), [f32; 3]), LightingError> {
    let place = lo_insert::surface_at_pixel(estimate, u, v).map_err(LightingError::White)?;
    Ok((place, hue(colour_around(&estimate.frame.photo, [u, v])?)))
}

/// Fixed-point steps to the tint of what is white: each takes away most of the rest.
const WHITE_STEPS: usize = 4;

/// Most that a channel's gain changes by for what is white.
const MAX_TINT: f32 = 4.0;

/// Gains under which light has the colour of the photo where that shows something white.
fn tint_of_white(
    estimate: &Estimate,
    expected: &ExpectedLight,
    seen: &ObservedShading,
    white: [f64; 2],
) -> Result<[f32; 3], LightingError> {
    let (place, shown) = white_surface(estimate, white)?;
    let mut tint = [1.0; 3];
    for _ in 0..WHITE_STEPS {
        let mut light = estimate.light.clone();
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
