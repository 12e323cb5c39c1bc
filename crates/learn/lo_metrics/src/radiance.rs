//! Errors of a radiance image against the true one.
//!
//! Functions take the true image, the estimated one and a weight per pixel. They return `None` if no weight is
//! positive. The weight of a panorama's pixel is its solid angle ([`solid_angles_sr`]); the seen or unseen part has
//! weight 0 elsewhere.

use lo_imaging::{RadianceImage, srgb_from_linear};

/// Returns the solid angle of every pixel of an equirectangular image, row by row, in steradians.
pub fn solid_angles_sr(width: usize, height: usize) -> Vec<f32> {
    let row = |y: usize| std::iter::repeat_n(lo_geometry::pixel_solid_angle_sr(y, width, height), width);
    (0..height).flat_map(row).collect()
}

/// Tone curve applied before PSNR; values range from 0 to 1.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PsnrCurve {
    /// sRGB curve of radiance clipped to `[0, 1]`, where 1 is the photo's white. The default.
    ClippedSrgb,
    /// `L / (1 + L)` per channel (Reinhard et al. 2002, eq. 3): distinguishes lamps brighter than white.
    Reinhard,
}

impl PsnrCurve {
    fn apply(self, value: f32) -> f64 {
        let value = value.max(0.0);
        f64::from(match self {
            Self::ClippedSrgb => srgb_from_linear(value.min(1.0)),
            Self::Reinhard if value.is_infinite() => 1.0,
            Self::Reinhard => value / (1.0 + value),
        })
    }
}

/// Upper limit of PSNR in tables: equal images would have an infinite one and spoil means.
pub const MAX_PSNR_DB: f64 = 100.0;

/// Returns the default PSNR of a panorama: [`psnr_db`] with [`PsnrCurve::ClippedSrgb`], weighted by solid angle.
///
/// At most [`MAX_PSNR_DB`]; `None` for a panorama without pixels.
pub fn panorama_psnr_db(truth: &RadianceImage, got: &RadianceImage) -> Option<f64> {
    let weights = solid_angles_sr(truth.width(), truth.height());
    psnr_db(truth, got, &weights, PsnrCurve::ClippedSrgb).map(|db| db.min(MAX_PSNR_DB))
}

/// Returns the peak signal-to-noise ratio in dB, `−10 log₁₀ (Σ w (t(Î) − t(I))² / Σ w)`, with the tone curve `t`.
///
/// The squared error is averaged over the channels; the peak is 1. Infinite for equal images.
pub fn psnr_db(truth: &RadianceImage, got: &RadianceImage, weights: &[f32], curve: PsnrCurve) -> Option<f64> {
    let squared = |a: f32, b: f32| (curve.apply(a) - curve.apply(b)).powi(2);
    mean_over_channels(truth, got, weights, squared).map(|mse| -10.0 * mse.log10())
}

/// Returns the root mean squared error of linear radiance, `√(Σ w (Î − I)² / Σ w)`, averaged over the channels.
///
/// In units of the true image.
pub fn rmse(truth: &RadianceImage, got: &RadianceImage, weights: &[f32]) -> Option<f64> {
    mean_over_channels(truth, got, weights, |a, b| (f64::from(b) - f64::from(a)).powi(2)).map(f64::sqrt)
}

/// Returns the root mean squared error of `ln(1 + radiance)`, averaged over the channels.
///
/// The networks' loss (`docs/method.md` §6) without its weight.
pub fn log_rmse(truth: &RadianceImage, got: &RadianceImage, weights: &[f32]) -> Option<f64> {
    let squared = |a: f32, b: f32| (f64::from(b.max(0.0)).ln_1p() - f64::from(a.max(0.0)).ln_1p()).powi(2);
    mean_over_channels(truth, got, weights, squared).map(f64::sqrt)
}

/// Returns the scale-invariant RMSE: [`rmse`] of the estimate times the best factor, `α = Σ w I·Î / Σ w Î·Î`.
///
/// One factor for all channels (Grosse et al. 2009), as in the evaluations of StyleLight and Weber et al. A black
/// estimate has its plain RMSE.
pub fn si_rmse(truth: &RadianceImage, got: &RadianceImage, weights: &[f32]) -> Option<f64> {
    let [mut both, mut own] = [0.0f64; 2];
    for_each(truth, got, weights, |weight, a, b| {
        for (&a, b) in a.iter().zip(b) {
            both += weight * f64::from(a) * f64::from(b);
            own += weight * f64::from(b).powi(2);
        }
    });
    let scale = if own > 0.0 { both / own } else { 1.0 };
    mean_over_channels(truth, got, weights, |a, b| (scale * f64::from(b) - f64::from(a)).powi(2)).map(f64::sqrt)
}

/// Returns [`si_rmse`] divided by the root mean square of the truth, in `[0, 1]`; `None` if the truth is black.
///
/// Independent of the scene's brightness, so that bright scenes do not dominate means. Equals the sine of the angle
/// between the two images as vectors.
pub fn relative_si_rmse(truth: &RadianceImage, got: &RadianceImage, weights: &[f32]) -> Option<f64> {
    let size = mean_over_channels(truth, got, weights, |a, _| f64::from(a).powi(2))?.sqrt();
    si_rmse(truth, got, weights).filter(|_| size > 0.0).map(|error| error / size)
}

/// Returns the RGB angular error in degrees: the mean of `acos(I·Î / |I||Î|)` (LeGendre et al. 2019).
///
/// Independent of intensity. Pixels that are black in either image are skipped, as in the evaluation of Weber et al.
pub fn angular_error_deg(truth: &RadianceImage, got: &RadianceImage, weights: &[f32]) -> Option<f64> {
    let [mut sum, mut total] = [0.0f64; 2];
    for_each(truth, got, weights, |weight, a, b| {
        let (a, b) = (a.map(f64::from), b.map(f64::from));
        let dot = |x: [f64; 3], y: [f64; 3]| x[0] * y[0] + x[1] * y[1] + x[2] * y[2];
        let lengths = (dot(a, a) * dot(b, b)).sqrt();
        if lengths > 0.0 {
            // atan2 of sine and cosine: the cosine alone loses small angles to rounding.
            let cross = [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
            sum += weight * dot(cross, cross).sqrt().atan2(dot(a, b)).to_degrees();
            total += weight;
        }
    });
    (total > 0.0).then(|| sum / total)
}

/// Returns the weighted mean of `error(true, estimated)` over pixels and channels.
fn mean_over_channels(
    truth: &RadianceImage,
    got: &RadianceImage,
    weights: &[f32],
    error: impl Fn(f32, f32) -> f64,
) -> Option<f64> {
    let [mut sum, mut total] = [0.0f64; 2];
    for_each(truth, got, weights, |weight, a, b| {
        sum += weight * (0..3).map(|c| error(a[c], b[c])).sum::<f64>() / 3.0;
        total += weight;
    });
    (total > 0.0).then(|| sum / total)
}

/// Visits every pixel with a positive weight, in order, so that sums do not depend on the number of threads.
fn for_each(
    truth: &RadianceImage,
    got: &RadianceImage,
    weights: &[f32],
    mut visit: impl FnMut(f64, [f32; 3], [f32; 3]),
) {
    assert_eq!((truth.width(), truth.height()), (got.width(), got.height()), "images of one size");
    assert_eq!(truth.pixels().len(), weights.len(), "one weight per pixel");
    for ((&a, &b), &weight) in truth.pixels().iter().zip(got.pixels()).zip(weights) {
        if weight > 0.0 {
            visit(f64::from(weight), a, b);
        }
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use proptest::prelude::*;

    fn grey(values: &[f32]) -> RadianceImage {
        RadianceImage::new(values.len(), 1, values.iter().map(|&v| [v; 3]).collect())
    }

    #[test]
    fn closed_forms() {
        let (truth, got) = (grey(&[1.0, 0.0, 3.0]), grey(&[0.5, 0.0, 5.0]));
        let ones = [1.0; 3];
        // Mean squared error: (0.25 + 0 + 4) / 3.
        assert!((rmse(&truth, &got, &ones).unwrap() - (4.25f64 / 3.0).sqrt()).abs() < 1e-12);
        // Only the last pixel has weight.
        assert!((rmse(&truth, &got, &[0.0, 0.0, 7.0]).unwrap() - 2.0).abs() < 1e-12);
        let log = ((1.5f64.ln() - 2f64.ln()).powi(2) + (6f64.ln() - 4f64.ln()).powi(2)) / 3.0;
        assert!((log_rmse(&truth, &got, &ones).unwrap() - log.sqrt()).abs() < 1e-12);
        // sRGB of 0.5 is 0.735357 (IEC 61966-2-1); the last pixel is clipped in both.
        let db = -10.0 * ((1.0f64 - 0.735_357).powi(2) / 3.0).log10();
        assert!((psnr_db(&truth, &got, &ones, PsnrCurve::ClippedSrgb).unwrap() - db).abs() < 1e-4);
        // Differences: 1/2 − 1/3 and 5/6 − 3/4.
        let db = -10.0 * (((1.0 / 6.0f64).powi(2) + (1.0 / 12.0f64).powi(2)) / 3.0).log10();
        assert!((psnr_db(&truth, &got, &ones, PsnrCurve::Reinhard).unwrap() - db).abs() < 1e-5);
        assert_eq!(psnr_db(&truth, &truth, &ones, PsnrCurve::Reinhard), Some(f64::INFINITY));
        // α = (0.5 + 15) / (0.25 + 25), error = Σ I² − α Σ I Î
        let least = (10.0 - 15.5f64.powi(2) / 25.25) / 3.0;
        assert!((si_rmse(&truth, &got, &ones).unwrap() - least.sqrt()).abs() < 1e-9);
        assert!((si_rmse(&truth, &grey(&[0.0; 3]), &ones).unwrap() - (10.0f64 / 3.0).sqrt()).abs() < 1e-12);
        // Sine of the angle between (1, 0, 3) and (0.5, 0, 5).
        let sine = (1.0 - 15.5f64.powi(2) / (10.0 * 25.25)).sqrt();
        assert!((relative_si_rmse(&truth, &got, &ones).unwrap() - sine).abs() < 1e-9);
        assert_eq!((rmse(&truth, &got, &[0.0; 3]), relative_si_rmse(&grey(&[0.0; 3]), &got, &ones)), (None, None));
    }

    #[test]
    fn colours_differ_by_their_angle() {
        let truth = RadianceImage::new(3, 1, vec![[1.0, 0.0, 0.0], [1.0; 3], [0.0; 3]]);
        let got = RadianceImage::new(3, 1, vec![[5.0, 5.0, 0.0], [2.0, 2.0, 2.0], [1.0; 3]]);
        // 45° and 0°; the black pixel is skipped.
        assert!((angular_error_deg(&truth, &got, &[1.0; 3]).unwrap() - 22.5).abs() < 1e-9);
        assert!((angular_error_deg(&truth, &got, &[3.0, 1.0, 1.0]).unwrap() - 33.75).abs() < 1e-9);
        assert_eq!(angular_error_deg(&truth, &got, &[0.0, 0.0, 1.0]), None);
        // 1e-6 rad would be lost in the cosine, in f32 and in f64.
        let close = RadianceImage::new(1, 1, vec![[1.0, 1e-6, 0.0]]);
        let red = RadianceImage::new(1, 1, vec![[1.0, 0.0, 0.0]]);
        assert!((angular_error_deg(&red, &close, &[1.0]).unwrap().to_radians() / 1e-6 - 1.0).abs() < 1e-6);
    }

    #[test]
    fn a_panorama_counts_by_solid_angle() {
        // Off by 1 in the upper quarter of the height: (1 − sin 45°) / 2 of the sphere.
        let truth = RadianceImage::new(8, 4, vec![[0.0; 3]; 32]);
        let got = RadianceImage::from_fn(8, 4, |_, y| [if y == 0 { 1.0 } else { 0.0 }; 3]);
        let expected = (0.5 * (1.0 - 0.5f64.sqrt())).sqrt();
        assert!((rmse(&truth, &got, &solid_angles_sr(8, 4)).unwrap() - expected).abs() < 1e-6);
    }

    #[test]
    fn the_psnr_of_a_panorama_is_of_what_a_screen_shows_and_weighs_by_solid_angle() {
        let grey = |value: f32| RadianceImage::from_fn(8, 4, |_, _| [value; 3]);
        // sRGB of 0.214041 is 0.5; radiance above 1 is clipped.
        let db = panorama_psnr_db(&grey(7.0), &grey(0.214_041_14)).unwrap();
        assert!((db - 6.0206).abs() < 1e-3, "{db}");
        // Black against white in the upper quarter of the height: (1 − sin 45°) / 2 of the sphere, not 1/4.
        let lit_above = RadianceImage::from_fn(8, 4, |_, y| [if y == 0 { 1.0 } else { 0.0 }; 3]);
        let expected = -10.0 * (0.5 * (1.0 - 0.5f64.sqrt())).log10();
        assert!((panorama_psnr_db(&grey(0.0), &lit_above).unwrap() - expected).abs() < 1e-5);
        assert_eq!(panorama_psnr_db(&grey(0.3), &grey(0.3)), Some(MAX_PSNR_DB));
    }

    proptest! {
        #[test]
        fn si_rmse_is_the_least_over_all_scales(
            pixels in prop::collection::vec((prop::array::uniform3(0.0..9.0f32), prop::array::uniform3(0.0..9.0f32), 0.1..2.0f32), 2..20)
        ) {
            let truth = RadianceImage::new(pixels.len(), 1, pixels.iter().map(|p| p.0).collect());
            let got = RadianceImage::new(pixels.len(), 1, pixels.iter().map(|p| p.1).collect());
            let weights: Vec<f32> = pixels.iter().map(|p| p.2).collect();
            let least = si_rmse(&truth, &got, &weights).unwrap();
            for scale in [0.3f32, 0.9, 1.0, 1.1, 2.5] {
                let scaled = got.map(|rgb| rgb.map(|v| v * scale));
                prop_assert!(rmse(&truth, &scaled, &weights).unwrap() >= least - 1e-6);
                prop_assert!((si_rmse(&truth, &scaled, &weights).unwrap() - least).abs() < 1e-4);
            }
        }
    }
}
