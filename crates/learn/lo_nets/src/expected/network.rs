//! Expected-light network: from a photo's statistics to the expected panorama.

use std::sync::OnceLock;

use burn::module::Module;
use burn::tensor::{Device, Tensor, TensorData, activation};
use lo_geometry::{Quat, Vec3, pixel_direction, pixel_solid_angle_sr};
use lo_imaging::{RadianceImage, luminance};
use lo_random::{RngExt, Stream};

use super::directions::ring_directions;
use super::statistics::{PhotoStatistics, STATISTICS};
use crate::energy::LUMINANCE;
use crate::layers::Linear;

/// Rows of the predicted panorama.
pub const PANORAMA_HEIGHT: usize = 32;

/// Rows of the panorama in losses.
pub(super) const LOSS_HEIGHT: usize = 16;

const HIDDEN: usize = 64;

/// Number of rings of lobes, and total number of lobes.
const RINGS: usize = 7;
const LOBES: usize = 64;

/// Sharpness λ of a lobe e^(λ (cos − 1)). At this value, spherical Gaussians overlap without gaps.
const SHARPNESS: f32 = 10.0;

/// Constant radiance relative to the photo's mean luminance.
const FLOOR: f32 = 0.02;

/// Scale of the outputs that tint the light, in log colour.
const TINT_SCALE: f64 = 0.3;

/// Number of outputs that tint the light: a mean and a slope along three axes for each channel.
const TINT_OUTPUTS: usize = 12;

/// Initial prediction of the contrast in stops.
const INITIAL_STOPS: f32 = 3.0;

const OUTPUTS: usize = LOBES + 1 + TINT_OUTPUTS + 1;

/// Dropout rate in training.
const DROPOUT: f32 = 0.3;

/// Upper limit of the log scale of all lobes.
const MAX_LOG_SCALE: f64 = 5.0;

/// Network with two hidden layers of 64, from [`STATISTICS`] numbers to spherical Gaussians and a tint.
#[derive(Module, Debug)]
pub struct ExpectedLightNet {
    /// Layer from the statistics.
    pub first: Linear,
    /// Layer between the hidden layers.
    pub second: Linear,
    /// Layer to the lobes' amplitudes, their common log scale, tints and contrast.
    pub output: Linear,
}

/// Expected light around a photo.
#[derive(Clone, Debug)]
pub struct ExpectedLight {
    /// Equirectangular panorama in the level frame: linear RGB radiance in the photo's units.
    pub radiance: RadianceImage,
    /// Rotation from the level frame's axes to the camera's.
    pub camera_from_level: Quat,
    /// Expected log2 of largest over smallest irradiance on a matte sphere.
    pub contrast_stops: f32,
}

/// Output of the network in the units of each photo.
pub(super) struct ExpectedOutput {
    /// Linear RGB radiance: three tensors of `[photos, pixels]`.
    pub channels: [Tensor<2>; 3],
    /// Contrast in stops, `[photos, 1]`.
    pub contrast_stops: Tensor<2>,
}

/// Lobes `[LOBES, pixels]` and axes `[4, pixels]`, evaluated at the pixels of a panorama.
struct PanoramaBasis {
    lobes: Vec<f32>,
    axes: Vec<f32>,
    pixels: usize,
}

impl PanoramaBasis {
    fn new(height: usize) -> Self {
        let pixels: Vec<(Vec3, f32)> = (0..2 * height * height)
            .map(|i| {
                let (x, y) = (i % (2 * height), i / (2 * height));
                (pixel_direction(x, y, 2 * height, height), pixel_solid_angle_sr(y, 2 * height, height))
            })
            .collect();
        let lobe = |axis: &Vec3| {
            let values = pixels.iter().map(|(direction, _)| (SHARPNESS * (direction.dot(*axis) - 1.0)).exp());
            let sum: f32 = values.clone().zip(&pixels).map(|(value, (_, solid_angle))| value * solid_angle).sum();
            // Normalises each lobe to its share of the sphere: amplitudes of 1 give a radiance of about 1.
            let scale = 4.0 * std::f32::consts::PI / LOBES as f32 / sum;
            values.map(|value| scale * value).collect::<Vec<f32>>()
        };
        let lobes = ring_directions(RINGS).iter().flat_map(lobe).collect();
        let axis = |of: fn(Vec3) -> f32| pixels.iter().map(move |&(direction, _)| of(direction));
        let axes = axis(|_| 1.0).chain(axis(|d| d.x)).chain(axis(|d| d.y)).chain(axis(|d| d.z)).collect();
        Self { lobes, axes, pixels: pixels.len() }
    }

    fn of_height(height: usize) -> &'static Self {
        static BASES: [OnceLock<PanoramaBasis>; 2] = [OnceLock::new(), OnceLock::new()];
        let which = usize::from(height == PANORAMA_HEIGHT);
        BASES[which].get_or_init(|| Self::new([LOSS_HEIGHT, PANORAMA_HEIGHT][which]))
    }
}

/// Returns the photo's mean colour at half saturation and luminance 1, as logarithms. Light is less saturated than
/// surfaces.
fn log_half_chroma(mean: [f32; 3]) -> [f32; 3] {
    let root = mean.map(|c| c.max(1e-6).sqrt());
    root.map(|c| (c / luminance(root)).max(1e-3).ln())
}

fn rows<const N: usize>(
    photos: &[&PhotoStatistics],
    of: impl Fn(&PhotoStatistics) -> [f32; N],
    device: &Device,
) -> Tensor<2> {
    let values: Vec<f32> = photos.iter().flat_map(|photo| of(photo)).collect();
    Tensor::from_data(TensorData::new(values, [photos.len(), N]), device)
}

impl ExpectedLightNet {
    /// Creates a network with weights drawn from `seed`. Its initial prediction is constant light of the photo's
    /// brightness.
    pub fn new(seed: u64, device: &Device) -> Self {
        let mut stream = lo_random::stream(seed, "expected light", 0);
        let stream = &mut stream;
        let mut bias = vec![0.0; OUTPUTS];
        bias[..LOBES].fill(0.5);
        Self {
            first: Linear::with_bias([STATISTICS, HIDDEN], stream, device),
            second: Linear::with_bias([HIDDEN, HIDDEN], stream, device),
            output: Linear::constant(HIDDEN, &bias, device),
        }
    }

    /// Predicts expected light: the mean of the predictions for the photo and, mirrored back, for its mirror image.
    pub fn predict(&self, statistics: &PhotoStatistics) -> ExpectedLight {
        let both = [statistics.clone(), statistics.mirrored()];
        let output = self.predict_panoramas(&both.each_ref(), None, PANORAMA_HEIGHT);
        let channels = output.channels.map(|channel| channel.into_data().iter::<f32>().collect::<Vec<f32>>());
        let (width, height) = (2 * PANORAMA_HEIGHT, PANORAMA_HEIGHT);
        let radiance = RadianceImage::from_fn(width, height, |x, y| {
            let (own, mirrored) = (y * width + x, width * height + y * width + (width - 1 - x));
            [0, 1, 2].map(|c| 0.5 * (channels[c][own] + channels[c][mirrored]))
        });
        let stops: Vec<f32> = output.contrast_stops.into_data().iter().collect();
        let contrast_stops = 0.5 * (stops[0] + stops[1]);
        ExpectedLight { radiance, camera_from_level: statistics.camera_from_level, contrast_stops }
    }

    /// Predicts panoramas of `height` rows. A `stream` enables dropout and draws it.
    pub(super) fn predict_panoramas(
        &self,
        photos: &[&PhotoStatistics],
        stream: Option<&mut Stream>,
        height: usize,
    ) -> ExpectedOutput {
        let device = self.output.weights.lazy_device();
        let values: Vec<f32> = photos.iter().flat_map(|photo| photo.values.iter().copied()).collect();
        let x = Tensor::<2>::from_data(TensorData::new(values, [photos.len(), STATISTICS]), &device);
        let raw = self.forward(x, stream);
        let basis = PanoramaBasis::of_height(height);
        let constant = |values: &[f32], rows: usize| {
            Tensor::<2>::from_data(TensorData::new(values.to_vec(), [rows, basis.pixels]), &device)
        };
        let scale = raw.clone().narrow(1, LOBES, 1).clamp_max(MAX_LOG_SCALE).exp();
        let amplitudes = activation::softplus(raw.clone().narrow(1, 0, LOBES), 1.0) * scale;
        let brightness = rows(photos, |photo| [luminance(photo.mean)], &device);
        let light = (amplitudes.matmul(constant(&basis.lobes, LOBES)) + FLOOR) * brightness;
        let hue = rows(photos, |photo| log_half_chroma(photo.mean), &device);
        let axes = constant(&basis.axes, 4);
        let tint = |c: usize| {
            let slopes = raw.clone().narrow(1, LOBES + 1 + 4 * c, 4).matmul(axes.clone()) * TINT_SCALE;
            (slopes + hue.clone().narrow(1, c, 1)).exp()
        };
        let [r, g, b] = [0, 1, 2].map(tint);
        let [kr, kg, kb] = LUMINANCE;
        let gain = light / (r.clone() * kr + g.clone() * kg + b.clone() * kb);
        let channels = [r * gain.clone(), g * gain.clone(), b * gain];
        ExpectedOutput { channels, contrast_stops: raw.narrow(1, OUTPUTS - 1, 1) + INITIAL_STOPS }
    }

    /// Runs the layers: `[photos, STATISTICS] → [photos, OUTPUTS]`.
    fn forward(&self, x: Tensor<2>, mut stream: Option<&mut Stream>) -> Tensor<2> {
        let mut drop = |x: Tensor<2>| {
            let Some(stream) = stream.as_deref_mut() else { return x };
            let (size, device) = (x.dims(), x.device());
            let kept = |_| if stream.random::<f32>() < DROPOUT { 0.0 } else { 1.0 / (1.0 - DROPOUT) };
            let mask: Vec<f32> = (0..size[0] * size[1]).map(kept).collect();
            x * Tensor::from_data(TensorData::new(mask, size), &device)
        };
        let x = drop(x);
        let x = drop(activation::relu(self.first.forward(x)));
        let x = drop(activation::relu(self.second.forward(x)));
        self.output.forward(x)
    }
}

#[cfg(test)]
mod tests {
    use lo_geometry::{Camera, Vec3};
    use lo_imaging::DepthMap;

    use super::*;

    fn statistics(brightness: f32) -> PhotoStatistics {
        let photo = RadianceImage::from_fn(48, 32, |x, _| {
            [brightness * (0.2 + 0.01 * x as f32), 0.3 * brightness, 0.1 * brightness]
        });
        let camera = Camera::from_hfov_deg(70.0, 48, 32).expect("a camera");
        PhotoStatistics::new(&photo, &DepthMap::from_fn(48, 32, |_, _| 2.0), &camera, Vec3::Y)
    }

    #[test]
    fn initial_light_is_constant_with_half_the_photos_saturation() {
        let predicted = ExpectedLightNet::new(1, &Device::flex()).predict(&statistics(1.0));
        let first = predicted.radiance.pixels()[0];
        let even =
            predicted.radiance.pixels().iter().all(|pixel| (luminance(*pixel) / luminance(first) - 1.0).abs() < 0.1);
        assert!(even && predicted.contrast_stops == INITIAL_STOPS);
        let mean = statistics(1.0).mean;
        assert!((first[0] / first[2] - (mean[0] / mean[2]).sqrt()).abs() < 1e-3, "{first:?}");
        assert!((0.8..1.3).contains(&(luminance(first) / luminance(mean))), "{first:?} {mean:?}");
    }

    #[test]
    fn a_mirrored_photo_has_a_mirrored_panorama() {
        let mut net = ExpectedLightNet::new(3, &Device::flex());
        let mut stream = lo_random::stream(3, "test", 0);
        net.output = Linear::with_bias([HIDDEN, OUTPUTS], &mut stream, &Device::flex());
        let own = net.predict(&statistics(0.5)).radiance;
        let other = net.predict(&statistics(0.5).mirrored()).radiance;
        for (x, y) in [(3, 5), (40, 20), (63, 31)] {
            let (a, b) = (own[(x, y)], other[(63 - x, y)]);
            assert!(a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-4 * (1.0 + b)), "{a:?} {b:?}");
        }
        assert!(own != RadianceImage::from_fn(64, 32, |x, y| own[(63 - x, y)]));
    }
}
