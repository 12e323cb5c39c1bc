//! Figures of one object at one footprint.

use std::collections::HashMap;

use lo_geometry::{Vec3, pixel_direction, pixel_solid_angle_sr};
use lo_imaging::{RadianceImage, luminance, main_light};
use lo_insert::Composite;
use lo_metrics::{rmse, si_rmse};

use super::truth::{ObjectTruth, STRIDE};

/// Smallest coverage at which a pixel of the object is compared.
pub(crate) const MIN_ALPHA: f32 = 0.999;

/// Smallest number of pixels for a figure.
const MIN_PIXELS: usize = 12;

/// Returns RMSE and scale-invariant RMSE of the object's radiance.
pub(crate) fn object(truth: &ObjectTruth, got: &Composite) -> Option<[f64; 2]> {
    let both = truth.object.iter().filter_map(|&([x, y], radiance)| {
        let alpha = got.alpha[(x, y)];
        (alpha > MIN_ALPHA).then(|| (radiance, got.object[(x, y)].map(|v| v / alpha)))
    });
    let (truth, got): (Vec<_>, Vec<_>) = both.unzip();
    if truth.len() < MIN_PIXELS {
        return None;
    }
    let ones = vec![1.0; truth.len()];
    let image = |pixels: Vec<[f32; 3]>| RadianceImage::new(pixels.len(), 1, pixels);
    let (truth, got) = (image(truth), image(got));
    Some([rmse(&truth, &got, &ones)?, si_rmse(&truth, &got, &ones)?])
}

/// Figures of a shadow.
pub(crate) struct ShadowFigures {
    /// Root mean square error of the irradiance ratio.
    pub rms: f64,
    /// Pearson correlation of the differences between neighbouring ratios.
    pub gradient_correlation: Option<f64>,
    /// Darkening within one radius of the object's base, and from one to six.
    pub darkening: [Darkening; 2],
}

/// Sums of 1 − ratio over the pixels of a zone of the shadow.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Darkening {
    pub truth: f64,
    pub got: f64,
}

impl std::ops::AddAssign for Darkening {
    fn add_assign(&mut self, other: Self) {
        *self = Self { truth: self.truth + other.truth, got: self.got + other.got };
    }
}

/// Compares the shadow where the supporting surface is visible in both images.
///
/// `radii` returns the distance between a pixel's point on the supporting surface and the object's base.
pub(crate) fn shadow(truth: &ObjectTruth, got: &Composite, radii: impl Fn([usize; 2]) -> f32) -> Option<ShadowFigures> {
    let shown: HashMap<[usize; 2], (f32, f32)> = truth
        .shadow
        .iter()
        .filter(|([x, y], _)| got.alpha[(*x, *y)] == 0.0)
        .map(|&([x, y], ratio)| ([x, y], (luminance(ratio), luminance(got.shadow_ratio[(x, y)]))))
        .collect();
    if shown.len() < MIN_PIXELS {
        return None;
    }
    let sum: f64 = shown.values().map(|&(a, b)| f64::from(a - b).powi(2)).sum();
    let mut differences: Vec<(f64, f64)> = Vec::new();
    let mut darkening = [Darkening::default(); 2];
    // In the order of the list, so that sums are reproducible.
    for &([x, y], _) in &truth.shadow {
        let Some(own) = shown.get(&[x, y]) else { continue };
        let zone = usize::from(radii([x, y]) > 1.0);
        darkening[zone] += Darkening { truth: 1.0 - f64::from(own.0), got: 1.0 - f64::from(own.1) };
        for neighbour in [[x + STRIDE, y], [x, y + STRIDE]] {
            if let Some(other) = shown.get(&neighbour) {
                differences.push((f64::from(other.0 - own.0), f64::from(other.1 - own.1)));
            }
        }
    }
    let rms = (sum / shown.len() as f64).sqrt();
    Some(ShadowFigures { rms, gradient_correlation: correlation(&differences), darkening })
}

/// Returns the Pearson correlation; 0 without variance, `None` with fewer than two pairs.
fn correlation(pairs: &[(f64, f64)]) -> Option<f64> {
    let count = pairs.len() as f64;
    let mean = |value: fn(&(f64, f64)) -> f64| pairs.iter().map(value).sum::<f64>() / count;
    let (a, b) = (mean(|p| p.0), mean(|p| p.1));
    let moment = |value: &dyn Fn(f64, f64) -> f64| pairs.iter().map(|p| value(p.0 - a, p.1 - b)).sum::<f64>();
    let spread = (moment(&|a, _| a * a) * moment(&|_, b| b * b)).sqrt();
    // A uniform shadow carries no information on its position.
    (count >= 2.0).then(|| if spread > 0.0 { moment(&|a, b| a * b) / spread } else { 0.0 })
}

/// Returns the direction and power of the main light.
///
/// Without a main light, returns the direction of the vector irradiance and no power.
fn dominant(map: &RadianceImage) -> Option<(Vec3, Option<f32>)> {
    if let Some(light) = main_light(map) {
        return Some((Vec3::from(light.direction), Some(luminance(light.power))));
    }
    let (width, height) = (map.width(), map.height());
    let weighted = |(x, y): (usize, usize)| {
        pixel_direction(x, y, width, height) * (luminance(map[(x, y)]) * pixel_solid_angle_sr(y, width, height))
    };
    let sum: Vec3 = (0..height).flat_map(|y| (0..width).map(move |x| (x, y))).map(weighted).sum();
    Some((sum.try_normalize()?, None))
}

/// Compares the dominant lights of two panoramas in one frame: angle in degrees, |log₂| of the ratio of powers.
pub(crate) fn dominant_lights(truth: &RadianceImage, got: &RadianceImage) -> Option<(f64, Option<f64>)> {
    let ((a, power_a), (b, power_b)) = (dominant(truth)?, dominant(got)?);
    let ratio = power_a.zip(power_b).map(|(a, b)| f64::from(b / a).log2().abs());
    Some((f64::from(a.angle_between(b)).to_degrees(), ratio.filter(|ratio| ratio.is_finite())))
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use lo_imaging::{Image, Photo};

    use super::*;

    /// Returns an image of 16 × 16 pixels; its right half is an object.
    fn picture(object: f32, shadow: impl Fn(usize, usize) -> f32) -> Composite {
        Composite {
            image: Photo::Linear(RadianceImage::from_fn(16, 16, |_, _| [1.0; 3])),
            object: RadianceImage::from_fn(16, 16, |x, _| [if x >= 8 { object } else { 0.0 }; 3]),
            alpha: Image::from_fn(16, 16, |x, _| if x >= 8 { 1.0 } else { 0.0 }),
            shadow_ratio: RadianceImage::from_fn(16, 16, |x, y| [shadow(x, y); 3]),
            reflection: None,
            grain: None,
            occlusion: Image::from_fn(16, 16, |_, _| 0.0),
            passes: None,
        }
    }

    fn truth() -> ObjectTruth {
        let pixels = || (0..16).step_by(STRIDE).flat_map(|y| (0..16).step_by(STRIDE).map(move |x| [x, y]));
        let object = pixels().filter(|[x, _]| *x >= 8).map(|pixel| (pixel, [2.0; 3])).collect();
        let shadow = pixels().filter(|[x, _]| *x < 8).map(|[x, y]| ([x, y], [1.0 - 0.05 * x as f32; 3])).collect();
        ObjectTruth { object, shadow }
    }

    #[test]
    fn what_is_equal_has_no_error_and_scale_is_told_apart() {
        let truth = truth();
        let same = picture(2.0, |x, _| 1.0 - 0.05 * x as f32);
        assert!(object(&truth, &same).unwrap().iter().all(|error| *error < 1e-6));
        // The base is in the corner, a radius is 6 pixels: columns 0, 3 and 6 within √(x² + y²) ≤ 6.
        let radii = |[x, y]: [usize; 2]| (x as f32).hypot(y as f32) / 6.0;
        let figures = shadow(&truth, &same, radii).unwrap();
        let [near, far] = figures.darkening;
        // Rows 0, 3 and 6 have 3, 2 and 1 near pixels; each of 6 rows sums to 0 + 0.15 + 0.3.
        assert!(
            (near.truth - (0.45 + 0.15)).abs() < 1e-5 && (far.truth - (6.0 * 0.45 - 0.6)).abs() < 1e-5,
            "{near:?} {far:?}"
        );
        assert!((near.got - near.truth).abs() < 1e-5 && (far.got - far.truth).abs() < 1e-5);
        assert!(figures.rms < 1e-6 && figures.gradient_correlation.unwrap() > 0.999);
        let brighter = picture(3.0, |_, y| 1.0 - 0.05 * y as f32);
        let [rmse, si_rmse] = object(&truth, &brighter).unwrap();
        assert!((rmse - 1.0).abs() < 1e-6 && si_rmse < 1e-6);
        // A shadow that falls the other way.
        let figures = shadow(&truth, &brighter, radii).unwrap();
        assert!(figures.rms > 0.1 && figures.gradient_correlation.unwrap() < 0.1, "{}", figures.rms);
        let even = shadow(&truth, &picture(2.0, |_, _| 1.0), radii).unwrap();
        assert_eq!((even.gradient_correlation, even.darkening[1].got), (Some(0.0), 0.0));
    }

    #[test]
    fn dominant_lights_are_compared_by_angle_and_power() {
        let map = |towards: Vec3, radiance: f32| {
            RadianceImage::from_fn(256, 128, |x, y| {
                let angle = pixel_direction(x, y, 256, 128).angle_between(towards);
                [if angle < 0.2 { radiance } else { 0.1 }; 3]
            })
        };
        let (angle_deg, ratio) = dominant_lights(&map(Vec3::Y, 8.0), &map(Vec3::X, 32.0)).unwrap();
        assert!((angle_deg - 90.0).abs() < 1.0 && (ratio.unwrap() - 2.0).abs() < 0.1, "{angle_deg} {ratio:?}");
        // No main light: half of the sphere is brighter.
        let half = RadianceImage::from_fn(64, 32, |x, y| {
            [if pixel_direction(x, y, 64, 32).dot(Vec3::X) > 0.0 { 1.2 } else { 1.0 }; 3]
        });
        let (angle_deg, ratio) = dominant_lights(&map(Vec3::X, 8.0), &half).unwrap();
        assert!(angle_deg < 1.0 && ratio.is_none(), "{angle_deg}");
    }
}
