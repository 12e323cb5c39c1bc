//! Gardner et al. 2017: one panorama of what a screen shows, and the intensity of lights in it.

use burn::module::Module;
use burn::tensor::{Device, Tensor, TensorData, activation, module::adaptive_avg_pool2d};
use lo_geometry::{Vec3, pixel_direction, pixel_solid_angle_sr};
use lo_imaging::{RadianceImage, linear_from_srgb, luminance, srgb_from_linear};
use lo_random::Stream;

use crate::example::{BaselineExample, PANORAMA};
use crate::features::{FeatureBatch, FeatureShape};
use crate::global::MapNet;
use crate::losses::{Losses, Term};
use crate::spheres::row_weights;

/// Channels from 4 × 8 to 64 × 128 pixels.
const CHANNELS: [usize; 5] = [192, 96, 48, 24, 16];

/// Size at which intensities are filtered.
const FILTERED: [usize; 2] = [32, 16];

/// Exponents of the cosine by which intensities are filtered, in equal parts of training: from blurred to sharp.
const EXPONENTS: [i32; 4] = [1, 4, 16, 64];

/// Largest log(1 + intensity).
const MAX_LOG: f64 = 9.0;

/// Luminance below which a panorama's pixel has no colour that a lamp could have.
const DARK: f32 = 0.02;

/// Network of Gardner et al. 2017.
#[derive(Module, Debug)]
pub struct GardnerNet {
    /// Decoder of colour and intensity.
    pub map: MapNet,
}

impl GardnerNet {
    pub(crate) fn new(shape: FeatureShape, stream: &mut Stream, device: &Device) -> Self {
        Self { map: MapNet::new(shape, &CHANNELS, 4, stream, device) }
    }

    /// Returns sRGB values `[3, images, 64, 128]` and log(1 + luminance above white) `[1, images, 64, 128]`.
    fn forward(&self, batch: &FeatureBatch) -> [Tensor<4>; 2] {
        let outputs = self.map.outputs(batch);
        let colour = activation::sigmoid(outputs.clone().narrow(0, 0, 3));
        // Most of a room is not a light.
        let light = activation::softplus(outputs.narrow(0, 3, 1) - 3.0, 1.0).clamp_max(MAX_LOG);
        [colour, light]
    }

    /// `progress` from 0 to 1 sharpens the comparison of intensities.
    pub(crate) fn losses(&self, batch: &FeatureBatch, examples: &[&BaselineExample], progress: f32) -> Losses {
        let device = batch.global.device();
        let [colour, light] = self.forward(batch);
        let [_, images, height, width] = colour.dims();
        let pixels = |value: &dyn Fn(&[f32; 3]) -> f32| -> Vec<f32> {
            examples.iter().flat_map(|example| example.panorama.pixels().iter().map(value)).collect()
        };
        let constant = |values: Vec<f32>, channels: usize| {
            Tensor::<4>::from_data(TensorData::new(values, [channels, images, height, width]), &device)
        };
        let shown = (0..3).flat_map(|c| pixels(&move |rgb| srgb_from_linear(rgb[c].clamp(0.0, 1.0))));
        let shown = constant(shown.collect(), 3);
        let weights = Tensor::<4>::from_data(TensorData::new(row_weights(height), [1, 1, height, 1]), &device);
        let colour = ((colour - shown).square() * weights).mean();
        let true_light = constant(pixels(&|&rgb| above_white(rgb).ln_1p()), 1);
        let part = ((progress * EXPONENTS.len() as f32) as usize).min(EXPONENTS.len() - 1);
        let filter = cosine_filter(EXPONENTS[part]);
        let [columns, rows] = FILTERED;
        let filter = Tensor::<2>::from_data(TensorData::new(filter, [columns * rows; 2]), &device);
        let filtered = |map: Tensor<4>| {
            adaptive_avg_pool2d(map, [rows, columns]).reshape([images, columns * rows]).matmul(filter.clone())
        };
        let light = (filtered(light) - filtered(true_light)).square().mean();
        Losses::new([Term::new("colour", colour, 10.0), Term::new("intensity", light, 1.0)])
    }

    pub(crate) fn predict(&self, batch: &FeatureBatch) -> RadianceImage {
        let [colour, light] = self.forward(batch).map(|map| map.into_data().iter().collect::<Vec<f32>>());
        let [width, height] = PANORAMA;
        RadianceImage::from_fn(width, height, |x, y| {
            let pixel = y * width + x;
            let rgb = [0, 1, 2].map(|c| linear_from_srgb(colour[c * width * height + pixel]));
            combined(rgb, light[pixel].exp_m1())
        })
    }
}

/// Returns the luminance above white, at least 0.
fn above_white(rgb: [f32; 3]) -> f32 {
    (luminance(rgb) - luminance(rgb.map(|v| v.min(1.0)))).max(0.0)
}

/// Adds a light of this luminance to a pixel, in the pixel's colour.
fn combined(rgb: [f32; 3], light: f32) -> [f32; 3] {
    let own = luminance(rgb);
    if own < DARK { rgb.map(|v| v + light) } else { rgb.map(|v| v * (1.0 + light / own)) }
}

/// Returns the matrix that averages a map of size [`FILTERED`] over directions by the power of the cosine:
/// `[from, to]`, whose columns add up to 1.
fn cosine_filter(exponent: i32) -> Vec<f32> {
    let [width, height] = FILTERED;
    let count = width * height;
    let directions: Vec<Vec3> = (0..count).map(|i| pixel_direction(i % width, i / width, width, height)).collect();
    let weight = |from: usize, to: usize| {
        let cosine = directions[from].dot(directions[to]).max(0.0);
        cosine.powi(exponent) * pixel_solid_angle_sr(from / width, width, height)
    };
    let sums: Vec<f32> = (0..count).map(|to| (0..count).map(|from| weight(from, to)).sum()).collect();
    (0..count * count).map(|i| weight(i / count, i % count) / sums[i % count]).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_filter_keeps_even_light_and_spreads_a_lamp_by_the_cosine() {
        for exponent in [1, 16] {
            let filter = cosine_filter(exponent);
            for to in [0, 77, 300] {
                let sum: f32 = (0..512).map(|from| filter[from * 512 + to]).sum();
                assert!((sum - 1.0).abs() < 1e-4);
            }
            // ∫ cosⁿ over a hemisphere is 2π / (n + 1).
            let lamp = 8 * 32 + 16;
            let solid_angle = pixel_solid_angle_sr(8, 32, 16);
            let expected = solid_angle * (exponent + 1) as f32 / std::f32::consts::TAU;
            assert!((filter[lamp * 512 + lamp] / expected - 1.0).abs() < 0.05, "{exponent}");
        }
    }

    #[test]
    fn colour_and_light_make_radiance_again() {
        for rgb in [[0.2, 0.5, 0.1], [3.0, 3.0, 3.0], [20.0, 10.0, 4.0]] {
            let again = combined(rgb.map(|v: f32| v.min(1.0)), above_white(rgb));
            assert!((luminance(again) / luminance(rgb) - 1.0).abs() < 1e-5, "{rgb:?} {again:?}");
        }
        assert_eq!(combined([0.0; 3], 7.0), [7.0; 3]);
    }
}
