//! Li et al. 2020: twelve spherical Gaussians at each seen pixel.

use burn::module::Module;
use burn::nn::conv::Conv2d;
use burn::tensor::{Device, Tensor, TensorData};
use lo_geometry::{Vec3, fibonacci_sphere};
use lo_imaging::RadianceImage;
use lo_nets::conv::conv2d;
use lo_nets::depth::{conv, panorama_loss};
use lo_random::Stream;

use crate::dense::{CELL_CHANNELS, Cells, DenseDecoder};
use crate::example::{BaselineExample, PROBE_MAP};
use crate::features::{FeatureBatch, FeatureShape};
use crate::gaussians::{Gaussian, render};
use crate::global::GlobalPath;
use crate::losses::{Losses, Term, probe_cells, probes};

/// Lobes of a pixel.
const LOBES: usize = 12;

/// Numbers of a lobe: three for its axis, its log sharpness, three log intensities.
const NUMBERS: usize = 7;

/// Sharpness of an untrained lobe: twelve of them overlap without gaps.
const SHARPNESS: f64 = 3.0;

/// Smallest and largest sharpness.
const SHARPNESS_RANGE: [f64; 2] = [0.2, 200.0];

/// Largest log intensity in units of the photo's mean colour.
const MAX_LOG_INTENSITY: f64 = 7.0;

/// Network of Li et al. 2020.
#[derive(Module, Debug)]
pub struct LiNet {
    /// Global vector, given to every cell.
    pub global: GlobalPath,
    /// Decoder of the cells' features.
    pub dense: DenseDecoder,
    /// Convolution to the lobes' numbers.
    pub output: Conv2d,
}

/// Lobes of some cells: axes `[cells · LOBES, 3]`, sharpness `[cells · LOBES, 1]`, intensities `[cells · LOBES, 3]`.
struct Lobes {
    axes: Tensor<2>,
    sharpness: Tensor<2>,
    intensity: Tensor<2>,
}

impl LiNet {
    pub(crate) fn new(shape: FeatureShape, stream: &mut Stream, device: &Device) -> Self {
        Self {
            global: GlobalPath::new(shape, stream, device),
            dense: DenseDecoder::new(shape, GlobalPath::length(shape), stream, device),
            output: conv([CELL_CHANNELS, LOBES * NUMBERS], 3, 1, true, stream, device),
        }
    }

    fn lobes(&self, batch: &FeatureBatch, cells: &Cells) -> Lobes {
        let dense = self.dense.forward(batch, self.global.forward(batch));
        let count = cells.at.len();
        // Small at the beginning, so that lobes start evenly spread.
        let numbers = cells.of(conv2d(dense, &self.output)).reshape([count, LOBES, NUMBERS]) * 0.3;
        let flat = |begin: usize, width: usize| numbers.clone().narrow(2, begin, width).reshape([count * LOBES, width]);
        let spread: Vec<f32> = fibonacci_sphere(LOBES).iter().flat_map(Vec3::to_array).collect();
        let spread = Tensor::<3>::from_data(TensorData::new(spread, [1, LOBES, 3]), &numbers.device());
        let axes = (numbers.clone().narrow(2, 0, 3) + spread).reshape([count * LOBES, 3]);
        let length = (axes.clone().square().sum_dim(1) + 1e-6).sqrt();
        let [least, most] = SHARPNESS_RANGE.map(f64::ln);
        let sharpness = (flat(3, 1) + SHARPNESS.ln()).clamp(least, most).exp();
        let colour = cells.of_images(batch.log_colour.clone()).reshape([count, 1, 3]);
        let colour = colour.expand([count, LOBES, 3]).reshape([count * LOBES, 3]);
        // Even light of the photo's colour: lobes of sharpness 3 add up to about twice one lobe's intensity.
        let intensity = ((flat(4, 3) - 0.7).clamp_max(MAX_LOG_INTENSITY) + colour).exp();
        Lobes { axes: axes / length, sharpness, intensity }
    }

    pub(crate) fn losses(&self, batch: &FeatureBatch, examples: &[&BaselineExample]) -> Losses {
        let Lobes { axes, sharpness, intensity } = self.lobes(batch, &probe_cells(examples));
        let maps = render(axes, sharpness, intensity, LOBES, PROBE_MAP);
        let truths: Vec<Option<&RadianceImage>> = probes(examples).map(|probe| Some(&probe.radiance)).collect();
        let [log, _, irradiance] = panorama_loss(maps, &truths);
        Losses::new([Term::new("light", log, 1.0), Term::new("rendering", irradiance, 0.1)])
    }

    /// Returns the lobes of some cells of one photo.
    pub(crate) fn predict(&self, batch: &FeatureBatch, cells: &Cells) -> Vec<Vec<Gaussian>> {
        let Lobes { axes, sharpness, intensity } = self.lobes(batch, cells);
        let [axes, sharpness, intensity] =
            [axes, sharpness, intensity].map(|x| x.into_data().iter().collect::<Vec<f32>>());
        let (axes, intensity) = (axes.as_chunks::<3>().0, intensity.as_chunks::<3>().0);
        let lobe = |i: usize| Gaussian { axis: axes[i].into(), sharpness: sharpness[i], intensity: intensity[i] };
        (0..cells.at.len()).map(|cell| (LOBES * cell..LOBES * (cell + 1)).map(lobe).collect()).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{SHAPE, example, recording_device};

    #[test]
    fn lobes_are_those_that_the_loss_renders() {
        let net = LiNet::new(SHAPE, &mut lo_random::stream(1, "test", 0), &Device::flex());
        let example = example(1);
        let batch = FeatureBatch::new(&[&example.features], &Device::flex());
        let cells = Cells::of_photo(example.features.shown);
        let light = net.predict(&batch, &cells);
        let Lobes { axes, sharpness, intensity } = net.lobes(&batch, &cells);
        let maps = render(axes, sharpness, intensity, LOBES, PROBE_MAP);
        let maps: Vec<f32> = maps.into_data().iter().collect();
        let direction = lo_geometry::pixel_direction(20, 5, 32, 16);
        for (cell, lobes) in light.iter().enumerate() {
            assert!(lobes.iter().all(|lobe| (lobe.axis.length() - 1.0).abs() < 1e-3));
            for c in 0..3 {
                let expected: f32 = lobes.iter().map(|lobe| lobe.radiance(direction)[c]).sum();
                let got = maps[((c * light.len() + cell) * 16 + 5) * 32 + 20];
                assert!((got / expected - 1.0).abs() < 1e-4, "{got} {expected}");
            }
        }
    }

    #[test]
    fn cells_of_a_batch_have_the_light_of_their_photo() {
        let examples = [example(1), example(2)];
        let net = LiNet::new(SHAPE, &mut lo_random::stream(1, "test", 0), &recording_device());
        let both = [&examples[0], &examples[1]];
        let loss = |examples: &[&BaselineExample]| {
            let features: Vec<_> = examples.iter().map(|example| &example.features).collect();
            net.losses(&FeatureBatch::new(&features, &recording_device()), examples).values()[0].1
        };
        let expected = 0.5 * (loss(&both[..1]) + loss(&both[1..]));
        assert!((loss(&both) / expected - 1.0).abs() < 1e-4);
    }
}
