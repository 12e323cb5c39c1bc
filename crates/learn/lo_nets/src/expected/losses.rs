//! Losses of expected light: irradiance at surfaces of all orientations by the unobserved part of the sphere.

use std::sync::OnceLock;

use burn::tensor::{Tensor, TensorData};
use lo_geometry::{Camera, pixel_direction, pixel_solid_angle_sr};
use lo_imaging::{RadianceImage, luminance, resize, sample_equirectangular};
use lo_random::Stream;

use super::network::{ExpectedLightNet, LOSS_HEIGHT};
use super::statistics::PhotoStatistics;
use crate::energy::{self, NORMALS};

/// Number of pixels of the panorama in losses.
const PIXELS: usize = 2 * LOSS_HEIGHT * LOSS_HEIGHT;

/// Rows of the panorama over which the true irradiance is integrated.
const TRUTH_HEIGHT: usize = 64;

/// Training target for a photo's statistics.
#[derive(Clone, Debug, PartialEq)]
pub struct ExpectedTruth {
    /// Unobserved share of each of the `PIXELS` pixels.
    unobserved_share: Vec<f32>,
    /// Irradiance over π by the unobserved part of the sphere: linear RGB for each normal.
    irradiance: Vec<[f32; 3]>,
    /// log2 of largest over smallest irradiance by the whole sphere.
    contrast_stops: f32,
}

/// Terms of the loss.
#[derive(Clone, Debug)]
pub struct ExpectedLosses {
    /// Mean squared difference of the logarithms of irradiance.
    pub log_irradiance: Tensor<1>,
    /// Root mean square difference after optimal scaling, relative to the mean irradiance. Measures where light comes
    /// from.
    pub scale_invariant: Tensor<1>,
    /// Mean angle between the colours of irradiance, approximately in radians.
    pub colour: Tensor<1>,
    /// Mean squared difference of the contrast in stops.
    pub contrast: Tensor<1>,
}

impl ExpectedLosses {
    /// Returns the weighted sum of the terms.
    pub fn total(&self) -> Tensor<1> {
        self.log_irradiance.clone() * 0.5
            + self.scale_invariant.clone()
            + self.colour.clone() * 2.0
            + self.contrast.clone() * 0.02
    }
}

fn truth_cosines() -> &'static [f32] {
    static COSINES: OnceLock<Vec<f32>> = OnceLock::new();
    COSINES.get_or_init(|| energy::panorama_cosines(2 * TRUTH_HEIGHT, TRUTH_HEIGHT))
}

fn loss_cosines() -> &'static [f32] {
    static COSINES: OnceLock<Vec<f32>> = OnceLock::new();
    COSINES.get_or_init(|| energy::panorama_cosines(2 * LOSS_HEIGHT, LOSS_HEIGHT))
}

impl ExpectedTruth {
    /// Computes the target from the true panorama at the camera, centred on the view, in the photo's units.
    ///
    /// With `mirrored`, computes the target for the mirror image of the level frame.
    pub fn new(panorama: &RadianceImage, camera: &Camera, statistics: &PhotoStatistics, mirrored: bool) -> Self {
        let (width, height) = (2 * TRUTH_HEIGHT, TRUTH_HEIGHT);
        let panorama = if panorama.height() > height { &resize(panorama, width, height) } else { panorama };
        let mut share = vec![(0.0f32, 0.0f32); PIXELS];
        let (mut unobserved, mut all) = ([[0.0f32; 3]; NORMALS], [0.0f32; NORMALS]);
        for (i, cosines) in truth_cosines().chunks_exact(NORMALS).enumerate() {
            let (x, y) = (i % width, i / width);
            let mut level = pixel_direction(x, y, width, height);
            if mirrored {
                level.x = -level.x;
            }
            let direction = statistics.camera_from_level * level;
            let observed = camera.project(direction).is_some_and(|(u, v, _)| camera.contains(u, v));
            let radiance = sample_equirectangular(panorama, direction).map(|c| c.max(0.0));
            let solid_angle = pixel_solid_angle_sr(y, width, height);
            let scale = TRUTH_HEIGHT / LOSS_HEIGHT;
            let (sum, total) = &mut share[y / scale * 2 * LOSS_HEIGHT + x / scale];
            *total += solid_angle;
            let light = luminance(radiance);
            all.iter_mut().zip(cosines).for_each(|(sum, cosine)| *sum += cosine * light);
            if !observed {
                *sum += solid_angle;
                for (sum, cosine) in unobserved.iter_mut().zip(cosines) {
                    (0..3).for_each(|c| sum[c] += cosine * radiance[c]);
                }
            }
        }
        let (least, most) = all.iter().fold((f32::MAX, 0.0f32), |(low, high), &e| (low.min(e), high.max(e)));
        Self {
            unobserved_share: share.into_iter().map(|(sum, total)| sum / total).collect(),
            irradiance: unobserved.to_vec(),
            contrast_stops: (most.max(1e-6) / least.max(1e-6)).log2().min(8.0),
        }
    }
}

/// Computes the losses of a network on some photos. `stream` draws the dropout.
pub fn expected_losses(
    net: &ExpectedLightNet,
    examples: &[(&PhotoStatistics, &ExpectedTruth)],
    stream: Option<&mut Stream>,
) -> ExpectedLosses {
    let photos: Vec<&PhotoStatistics> = examples.iter().map(|&(statistics, _)| statistics).collect();
    let output = net.predict_panoramas(&photos, stream, LOSS_HEIGHT);
    let device = output.contrast_stops.device();
    let count = examples.len();
    let rows =
        |width: usize, values: Vec<f32>| Tensor::<2>::from_data(TensorData::new(values, [count, width]), &device);
    let truth_values =
        |of: &dyn Fn(&ExpectedTruth) -> Vec<f32>| examples.iter().flat_map(|&(_, truth)| of(truth)).collect();
    let unobserved_share = rows(PIXELS, truth_values(&|truth| truth.unobserved_share.clone()));
    let cosines = Tensor::<2>::from_data(TensorData::new(loss_cosines().to_vec(), [PIXELS, NORMALS]), &device);
    let got = output.channels.map(|channel| (channel * unobserved_share.clone()).matmul(cosines.clone()));
    let truth = [0, 1, 2]
        .map(|c| rows(NORMALS, truth_values(&|truth: &ExpectedTruth| truth.irradiance.iter().map(|e| e[c]).collect())));
    let log_irradiance = energy::log_difference(&got, &truth);
    let (got_light, true_light) = (energy::light(&got), energy::light(&truth));
    let mean = true_light.clone().mean_dim(1) + 1e-6;
    let squares = got_light.clone().square().sum_dim(1) + 1e-9;
    let scale = (got_light.clone() * true_light.clone()).sum_dim(1) / squares;
    let scaled = (got_light * scale - true_light) / mean;
    let scale_invariant = (scaled.square().mean_dim(1) + 1e-4).sqrt().mean();
    let colour = energy::colour_difference(&got, &truth);
    let stops = rows(1, truth_values(&|truth| vec![truth.contrast_stops]));
    let contrast = (output.contrast_stops - stops).square().mean();
    ExpectedLosses { log_irradiance, scale_invariant, colour, contrast }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use lo_geometry::{Vec3, fibonacci_sphere};
    use lo_imaging::DepthMap;

    use super::*;
    use crate::Adam;
    use crate::testing::{numbers, recording_device};

    fn statistics() -> (PhotoStatistics, Camera) {
        let photo = RadianceImage::from_fn(48, 32, |x, _| [0.2 + 0.01 * x as f32, 0.3, 0.3]);
        let camera = Camera::from_hfov_deg(75.0, 48, 32).unwrap();
        let depth_m = DepthMap::from_fn(48, 32, |x, _| 2.0 + 0.02 * x as f32);
        (PhotoStatistics::new(&photo, &depth_m, &camera, Vec3::Y), camera)
    }

    /// Constant light of 0.5 and a lamp of 6° radius, above and to the right of the camera.
    fn panorama(lamp: f32) -> RadianceImage {
        let towards = Vec3::new(0.8, 0.6, 0.0);
        RadianceImage::from_fn(256, 128, |x, y| {
            let bright = pixel_direction(x, y, 256, 128).dot(towards) > 6f32.to_radians().cos();
            [if bright { lamp } else { 0.5 }; 3]
        })
    }

    #[test]
    fn irradiance_of_constant_light_and_a_lamp_is_the_closed_form() {
        let (statistics, camera) = statistics();
        let even = ExpectedTruth::new(&panorama(0.5), &camera, &statistics, false);
        // At 75° and 3:2, a twelfth of the sphere is observed, and nothing of it lies above the camera.
        let up = fibonacci_sphere(NORMALS).iter().position(|normal| normal.y > 0.9).unwrap();
        assert!((even.irradiance[up][1] - 0.5).abs() < 0.06, "{:?}", even.irradiance[up]);
        assert!(even.contrast_stops.abs() < 0.05, "{}", even.contrast_stops);
        let lit = ExpectedTruth::new(&panorama(60.0), &camera, &statistics, false);
        // A cap of 6° has 0.0344 sr and adds 59.5 · 0.0344 / π where a surface faces it.
        let most = lit.irradiance.iter().map(|e| e[1]).fold(0.0, f32::max);
        assert!((most - (0.5 + 0.652)).abs() < 0.08, "{most}");
        let mirrored = ExpectedTruth::new(&panorama(60.0), &camera, &statistics, true);
        let brightest = |truth: &ExpectedTruth| {
            let at = (0..NORMALS).max_by(|&a, &b| truth.irradiance[a][1].total_cmp(&truth.irradiance[b][1]));
            fibonacci_sphere(NORMALS)[at.unwrap()]
        };
        assert!(brightest(&lit).x > 0.5 && brightest(&mirrored).x < -0.5);
        let unobserved_share: f32 = even.unobserved_share.iter().sum::<f32>() / PIXELS as f32;
        assert!((0.85..0.97).contains(&unobserved_share), "{unobserved_share}");
    }

    #[test]
    fn training_finds_a_lamps_position_and_contrast() {
        let (statistics, camera) = statistics();
        let truths = [false, true].map(|mirrored| ExpectedTruth::new(&panorama(60.0), &camera, &statistics, mirrored));
        let photos = [statistics.clone(), statistics.mirrored()];
        let examples = [(&photos[0], &truths[0]), (&photos[1], &truths[1])];
        let mut net = ExpectedLightNet::new(1, &recording_device());
        let mut adam = Adam::default();
        let loss = |net: &ExpectedLightNet| expected_losses(net, &examples, None).total();
        let before = numbers(loss(&net))[0];
        for _ in 0..150 {
            let gradients = loss(&net).backward();
            net = adam.step(net, &gradients, 5e-3);
        }
        let after = numbers(loss(&net))[0];
        assert!(after < 0.35 * before, "{before} {after}");
        use burn::module::Module;
        let predicted = net.valid().predict(&statistics);
        let brightest = (0..64 * 32)
            .max_by(|&a, &b| predicted.radiance.pixels()[a][1].total_cmp(&predicted.radiance.pixels()[b][1]));
        let towards = brightest.map(|i| pixel_direction(i % 64, i / 64, 64, 32)).unwrap();
        assert!(towards.dot(Vec3::new(0.8, 0.6, 0.0)) > 0.85, "{towards}");
        assert!((predicted.contrast_stops - truths[0].contrast_stops).abs() < 0.5);
    }
}
