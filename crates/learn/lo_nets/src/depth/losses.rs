use burn::tensor::{Tensor, TensorData};
use lo_imaging::{DepthMap, RadianceImage};
use serde::{Deserialize, Serialize};

use crate::energy::{self, Irradiance, NORMALS};
use crate::tone::tone;

/// Weights of the depth network's losses (`docs/method.md` §6). Every field has a default.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct DepthLossConfig {
    /// Mean squared difference of log depth, or of the logarithm of a quantity proportional to depth.
    pub log_depth: f32,
    /// Mean absolute difference of log depth. More robust than the square to pixels on depth edges, and closer to
    /// abs-rel and δ.
    pub absolute: f32,
    /// Variance of the difference of log depth, which ignores scale.
    pub scale_invariant: f32,
    /// Mean squared difference of log(1 + radiance) of the panorama.
    pub panorama: f32,
    /// Mean squared difference of the tone-mapped panorama. Dark regions count as they appear, lamps hardly at all.
    pub panorama_tone: f32,
    /// Difference of the irradiance under the panorama: squared difference of its logarithm, plus twice its angle in
    /// colour. Without it, lamps of uncertain position vanish.
    pub panorama_irradiance: f32,
    /// Adversarial loss of the panorama.
    pub adversarial: f32,
    /// Negative log-likelihood of the true perspective field.
    pub perspective: f32,
}

impl Default for DepthLossConfig {
    fn default() -> Self {
        Self {
            log_depth: 0.25,
            absolute: 1.0,
            scale_invariant: 0.5,
            panorama: 1.0,
            panorama_tone: 0.0,
            panorama_irradiance: 0.0,
            adversarial: 0.0,
            perspective: 0.1,
        }
    }
}

/// Returns mean square, mean absolute value and variance of the difference of log depth.
///
/// Each is taken over an image's pixels with a true reading (finite, above 0), then averaged over images.
/// `log_depth[1, images, height, width]` has the size and the unit of the `truths`.
///
/// # Panics
/// Where the sizes differ.
pub fn depth_losses(log_depth: Tensor<4>, truths: &[&DepthMap]) -> [Tensor<1>; 3] {
    let [_, images, height, width] = log_depth.dims();
    let fits = |truth: &&DepthMap| (truth.width(), truth.height()) == (width, height);
    assert!(truths.len() == images && truths.iter().all(fits), "true depth maps have the size of the predicted ones");
    let is_known = |z: f32| z.is_finite() && z > 0.0;
    let readings = || truths.iter().flat_map(|truth| truth.pixels());
    let known: Vec<f32> = readings().map(|&z| f32::from(u8::from(is_known(z)))).collect();
    let logs: Vec<f32> = readings().map(|&z| if is_known(z) { z.ln() } else { 0.0 }).collect();
    let counts = known.chunks(height * width).map(|known| known.iter().sum::<f32>().max(1.0)).collect();
    let device = log_depth.device();
    let constant =
        |values, pixels| Tensor::<2>::from_data(TensorData::new::<f32, _>(values, [images, pixels]), &device);
    let (known, logs) = (constant(known, height * width), constant(logs, height * width));
    let difference = (log_depth.reshape([images, height * width]) - logs) * known;
    let counts = constant(counts, 1);
    let mean_square = difference.clone().square().sum_dim(1) / counts.clone();
    let absolute = difference.clone().abs().sum_dim(1) / counts.clone();
    let square_mean = (difference.sum_dim(1) / counts).square();
    [mean_square.clone().mean(), absolute.mean(), (mean_square - square_mean).mean()]
}

/// Returns the mean squared differences of log(1 + radiance) and of tone-mapped radiance, and the difference of
/// irradiance ([`DepthLossConfig::panorama_irradiance`]).
///
/// Rows are weighted by solid angle. Means include only panoramas with a known truth.
/// `panorama[3, images, height, width]` has the size of the `truths`.
///
/// # Panics
/// Where the sizes differ.
pub fn panorama_loss(panorama: Tensor<4>, truths: &[Option<&RadianceImage>]) -> [Tensor<1>; 3] {
    let [_, images, height, width] = panorama.dims();
    let fits = |truth: &&RadianceImage| (truth.width(), truth.height()) == (width, height);
    let known: Vec<&RadianceImage> = truths.iter().copied().flatten().collect();
    assert!(truths.len() == images && known.iter().all(fits), "true panoramas have the size of the predicted ones");
    let device = panorama.device();
    if known.is_empty() {
        return [(); 3].map(|()| Tensor::zeros([1], &device));
    }
    let panorama = if known.len() == images {
        panorama
    } else {
        let of_known = truths.iter().enumerate().filter(|(_, truth)| truth.is_some());
        Tensor::cat(of_known.map(|(image, _)| panorama.clone().narrow(1, image, 1)).collect(), 1)
    };
    let channel = |c: usize| known.iter().flat_map(move |truth| truth.pixels().iter().map(move |pixel| pixel[c]));
    let size = [3, known.len(), height, width];
    let truth = Tensor::<4>::from_data(TensorData::new::<f32, _>((0..3).flat_map(channel).collect(), size), &device);
    let share = width as f32 / (4.0 * std::f32::consts::PI);
    let weights = (0..height).map(|y| share * lo_geometry::pixel_solid_angle_sr(y, width, height) * height as f32);
    let weights = Tensor::<4>::from_data(TensorData::new::<f32, _>(weights.collect(), [1, 1, height, 1]), &device);
    let mean_square = |difference: Tensor<4>| (difference.square() * weights.clone()).mean();
    let irradiance = |panorama: &Tensor<4>| panorama_irradiance(panorama.clone());
    [
        mean_square(panorama.clone().log1p() - truth.clone().log1p()),
        mean_square(tone(panorama.clone()) - tone(truth.clone())),
        energy::difference(&irradiance(&panorama), &irradiance(&truth)),
    ]
}

/// Returns the irradiance under equirectangular panoramas `[3, panoramas, height, width]`.
fn panorama_irradiance(panorama: Tensor<4>) -> Irradiance {
    let [_, panoramas, height, width] = panorama.dims();
    let cosines = energy::panorama_cosines(width, height);
    let size = [width * height, NORMALS];
    let cosines = Tensor::<2>::from_data(TensorData::new(cosines, size), &panorama.device());
    [0, 1, 2].map(|c| panorama.clone().narrow(0, c, 1).reshape([panoramas, width * height]).matmul(cosines.clone()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{numbers, recording_device};

    fn log_of([log, ..]: [Tensor<1>; 3]) -> f64 {
        numbers(log.inner())[0]
    }

    #[test]
    fn tone_curve_approximates_srgb() {
        let of = |got: f32| {
            let truth = RadianceImage::from_fn(4, 2, |_, _| [0.1; 3]);
            let x = Tensor::<4>::from_data(TensorData::new(vec![got; 24], [3, 1, 2, 4]), &recording_device());
            let [_, tone, _] = panorama_loss(x, &[Some(&truth)]);
            numbers(tone.inner())[0].sqrt()
        };
        for got in [0.0f32, 0.02, 0.2, 0.5, 1.0] {
            let srgb = f64::from(lo_imaging::srgb_from_linear(got) - lo_imaging::srgb_from_linear(0.1)).abs();
            assert!((of(got) - srgb).abs() < 0.06, "{got}: {} {srgb}", of(got));
        }
        assert!(of(100.0) > 1.5, "radiance above white counts");
    }

    #[test]
    fn variance_ignores_scale() {
        let truth = DepthMap::from_fn(6, 4, |x, y| if x == 2 { 0.0 } else { 1.0 + (x * y) as f32 });
        let of = |scale: f32| {
            let logs: Vec<f32> = truth.pixels().iter().map(|z| if *z > 0.0 { (scale * z).ln() } else { 7.0 }).collect();
            let logs = Tensor::<4>::from_data(TensorData::new(logs, [1, 1, 4, 6]), &recording_device());
            depth_losses(logs, &[&truth]).map(|loss| numbers(loss.inner())[0])
        };
        let [square, absolute, variance] = of(0.5);
        assert!((square - 2f64.ln().powi(2)).abs() < 1e-5 && variance.abs() < 1e-5, "{square} {variance}");
        assert!((absolute - 2f64.ln()).abs() < 1e-5, "{absolute}");
        assert!(of(1.0).iter().all(|loss| loss.abs() < 1e-6));
    }

    #[test]
    fn images_have_equal_weight() {
        // One image with few readings, one with many; errors of 1 and 3.
        let truths = [1, 4].map(|rows| DepthMap::from_fn(6, 4, |_, y| if y < rows { 1.0 } else { 0.0 }));
        let logs: Vec<f32> = (0..48).map(|i| if i < 24 { 1.0 } else { 3.0 }).collect();
        let logs = Tensor::<4>::from_data(TensorData::new(logs, [1, 2, 4, 6]), &recording_device());
        let [square, absolute, variance] = depth_losses(logs, &truths.each_ref()).map(|loss| numbers(loss.inner())[0]);
        assert!((square - 5.0).abs() < 1e-5 && variance.abs() < 1e-5, "{square} {variance}");
        assert!((absolute - 2.0).abs() < 1e-5, "{absolute}");
    }

    #[test]
    fn rows_are_weighted_by_solid_angle() {
        let truth = RadianceImage::from_fn(16, 8, |_, _| [0.0; 3]);
        let of = |bright: usize| {
            let values = (0..3 * 8 * 16).map(|i| if i / 16 % 8 == bright { 1.0f32.exp_m1() } else { 0.0 }).collect();
            let x = Tensor::<4>::from_data(TensorData::new::<f32, _>(values, [3, 1, 8, 16]), &recording_device());
            log_of(panorama_loss(x, &[Some(&truth)]))
        };
        let shares: Vec<f64> = (0..8).map(of).collect();
        assert!((shares.iter().sum::<f64>() - 1.0).abs() < 1e-5, "{shares:?}");
        // The spherical cap above 67.5° of latitude.
        assert!((shares[0] - 0.5 * (1.0 - (std::f64::consts::PI * 0.375).sin())).abs() < 1e-5);
    }

    #[test]
    fn irradiance_under_half_a_sphere_of_light_is_the_closed_form() {
        let values = (0..3 * 32 * 64).map(|i| if i / 64 % 32 < 16 { 1.0 } else { 0.0 }).collect();
        let x = Tensor::<4>::from_data(TensorData::new::<f32, _>(values, [3, 1, 32, 64]), &recording_device());
        let found = numbers(panorama_irradiance(x)[1].clone().inner());
        for (facing, found) in lo_geometry::fibonacci_sphere(NORMALS).iter().zip(found) {
            assert!((found - f64::from(0.5 * (1.0 + facing.y))).abs() < 3e-3, "{facing} {found}");
        }
    }

    #[test]
    fn panoramas_without_truth_are_ignored() {
        let truth = RadianceImage::from_fn(16, 8, |x, y| [x as f32, y as f32, 1.0]);
        let values = |images: usize| (0..3 * images * 128).map(|i| ((i * 37) % 11) as f32).collect::<Vec<f32>>();
        let x = Tensor::<4>::from_data(TensorData::new(values(3), [3, 3, 8, 16]), &recording_device());
        let middle = log_of(panorama_loss(x.clone().narrow(1, 1, 1), &[Some(&truth)]));
        assert!(middle > 0.1);
        assert_eq!(log_of(panorama_loss(x.clone(), &[None, Some(&truth), None])), middle);
        assert_eq!(log_of(panorama_loss(x, &[None, None, None])), 0.0);
    }
}
