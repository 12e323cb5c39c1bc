//! Garon et al. 2019: spherical harmonics of order 5 at a pixel, from global and local features.

use burn::module::Module;
use burn::nn::conv::Conv2d;
use burn::tensor::{Device, Tensor, TensorData, activation};
use lo_nets::conv::conv2d;
use lo_nets::depth::{ConvStage, conv};
use lo_nets::layers::Linear;
use lo_random::Stream;

use crate::dense::{CELL_CHANNELS, Cells};
use crate::example::{BaselineExample, PROBE_MAP};
use crate::features::{FeatureBatch, FeatureShape};
use crate::global::GlobalPath;
use crate::harmonics::{COEFFICIENTS, Harmonics, projection};
use crate::losses::{Losses, Term, probe_cells, probes};
use crate::planes::Planes;

/// Width of the hidden layers.
const HIDDEN: usize = 256;

/// Coefficients of light and of distance.
const OUTPUTS: usize = 4 * COEFFICIENTS;

/// Added to the root mean square of a probe's coefficients, in the photo's mean colour, by which errors are divided.
const DARK: f32 = 0.3;

/// Network of Garon et al. 2019.
#[derive(Module, Debug)]
pub struct GaronNet {
    /// Global path.
    pub global: GlobalPath,
    /// Local path: two convolutions around the cell.
    pub local: Vec<ConvStage>,
    /// Albedo of the cells, an auxiliary task of the local path.
    pub albedo: Conv2d,
    /// Hidden layers of global vector, local features and position.
    pub hidden: Vec<Linear>,
    /// Coefficients.
    pub output: Linear,
}

impl GaronNet {
    pub(crate) fn new(shape: FeatureShape, stream: &mut Stream, device: &Device) -> Self {
        let mut bias = [0.0; OUTPUTS];
        // Even light of the photo's mean colour.
        bias[..3].fill(2.0 * std::f32::consts::PI.sqrt());
        let inputs = GlobalPath::length(shape) + CELL_CHANNELS + 2;
        Self {
            global: GlobalPath::new(shape, stream, device),
            local: vec![
                ConvStage::new([shape.eighth + 3, CELL_CHANNELS], stream, device),
                ConvStage::new([CELL_CHANNELS, CELL_CHANNELS], stream, device),
            ],
            albedo: conv([CELL_CHANNELS, 3], 1, 1, true, stream, device),
            hidden: vec![
                Linear::with_bias([inputs, HIDDEN], stream, device),
                Linear::with_bias([HIDDEN, HIDDEN], stream, device),
            ],
            output: Linear::constant(HIDDEN, &bias, device),
        }
    }

    /// Returns local features `[channels, images, rows, columns]`.
    fn local(&self, batch: &FeatureBatch) -> Tensor<4> {
        let x = Tensor::cat(vec![batch.eighth.clone(), batch.photo.clone()], 0);
        self.local.iter().fold(x, |x, stage| stage.forward(x))
    }

    /// Returns the coefficients of light, `[cells, 3 · COEFFICIENTS]` with the channels of a coefficient together, in
    /// units of the photos' mean colours, and those of log(1 + distance), `[cells, COEFFICIENTS]`.
    fn coefficients(&self, batch: &FeatureBatch, local: Tensor<4>, cells: &Cells) -> [Tensor<2>; 2] {
        let [_, rows, columns] = batch.size();
        let positions = cells.positions([rows, columns], &batch.global.device());
        let x = Tensor::cat(vec![cells.of_images(self.global.forward(batch)), cells.of(local), positions], 1);
        let x = self.hidden.iter().fold(x, |x, layer| activation::relu(layer.forward(x)));
        let x = self.output.forward(x);
        [x.clone().narrow(1, 0, 3 * COEFFICIENTS), x.narrow(1, 3 * COEFFICIENTS, COEFFICIENTS)]
    }

    pub(crate) fn losses(&self, batch: &FeatureBatch, examples: &[&BaselineExample]) -> Losses {
        let device = batch.global.device();
        let (cells, local) = (probe_cells(examples), self.local(batch));
        let [light, distance] = self.coefficients(batch, local.clone(), &cells);
        let (count, [width, height]) = (cells.at.len(), PROBE_MAP);
        let projection =
            Tensor::<2>::from_data(TensorData::new(projection(PROBE_MAP), [width * height, COEFFICIENTS]), &device);
        let colour = cells.of_images(batch.log_colour.clone()).exp();
        // [probes, pixels · 3] → [probes, COEFFICIENTS · 3], in units of the photo's mean colour.
        let radiance: Vec<f32> =
            probes(examples).flat_map(|probe| probe.radiance.pixels().iter().flatten().copied()).collect();
        let radiance = Tensor::<3>::from_data(TensorData::new(radiance, [count, width * height, 3]), &device);
        let radiance = radiance / colour.reshape([count, 1, 3]);
        let truth = radiance.swap_dims(1, 2).reshape([3 * count, width * height]).matmul(projection.clone());
        let truth = truth.reshape([count, 3, COEFFICIENTS]).swap_dims(1, 2).reshape([count, 3 * COEFFICIENTS]);
        let distances: Vec<f32> =
            probes(examples).flat_map(|probe| probe.distance_m.pixels().iter().map(|d| d.max(0.0).ln_1p())).collect();
        let distances = Tensor::<2>::from_data(TensorData::new(distances, [count, width * height]), &device);
        let albedo = activation::sigmoid(conv2d(local, &self.albedo));
        let true_albedo: Vec<&Planes> = examples.iter().map(|example| &example.albedo).collect();
        let true_albedo = Planes::stack(&true_albedo, &device);
        let known = true_albedo.clone().sum_dim(0).greater_elem(0.0).float();
        Losses::new([
            Term::new("harmonics", relative_error(light, truth), 1.0),
            Term::new("distance", (distance - distances.matmul(projection)).square().mean(), 0.1),
            Term::new("albedo", ((albedo - true_albedo).square() * known).mean(), 0.5),
        ])
    }

    /// Returns the light at the shown cells of one photo.
    pub(crate) fn predict(&self, batch: &FeatureBatch, cells: &Cells) -> Vec<Harmonics> {
        let [light, _] = self.coefficients(batch, self.local(batch), cells);
        let colour = cells.of_images(batch.log_colour.clone()).exp();
        let [count, _] = light.dims();
        let light = light.reshape([count, COEFFICIENTS, 3]) * colour.reshape([count, 1, 3]);
        let values: Vec<f32> = light.into_data().iter().collect();
        let of_cell = |values: &[f32]| {
            let rgb = values.as_chunks::<3>().0;
            Harmonics { coefficients: std::array::from_fn(|lm| rgb[lm]) }
        };
        values.chunks_exact(3 * COEFFICIENTS).map(of_cell).collect()
    }
}

/// Returns the mean squared error of coefficients, each probe's relative to the size of its true ones.
///
/// Beside a lamp, a probe has a hundred times the linear radiance of other probes.
fn relative_error(got: Tensor<2>, truth: Tensor<2>) -> Tensor<1> {
    let size = truth.clone().square().mean_dim(1).sqrt() + DARK;
    ((got - truth) / size).square().mean()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{SHAPE, assert_gradient, example, lit, recording_device, values};

    #[test]
    fn an_untrained_network_predicts_the_photos_mean_colour() {
        let net = GaronNet::new(SHAPE, &mut lo_random::stream(1, "test", 0), &Device::flex());
        let example = example(1);
        let batch = FeatureBatch::new(&[&example.features], &Device::flex());
        let light = net.predict(&batch, &Cells::of_photo(example.features.shown));
        assert_eq!(light.len(), 32);
        let got = light[5].radiance(lo_geometry::Vec3::Y);
        let expected = [-1.0f32, -1.1, -1.3].map(f32::exp);
        assert!((0..3).all(|c| (got[c] / expected[c] - 1.0).abs() < 1e-4), "{got:?} {expected:?}");
    }

    #[test]
    fn the_target_is_the_projection_of_the_probe() {
        let example = example(2);
        let net = GaronNet::new(SHAPE, &mut lo_random::stream(1, "test", 0), &recording_device());
        let batch = FeatureBatch::new(&[&example.features], &recording_device());
        let loss = net.losses(&batch, &[&example]);
        // The untrained network has the photo's colour in Y₀₀ alone.
        let colour = [-1.0f32, -1.1, -1.3].map(f32::exp);
        let error = |column: f32| {
            let truth = Harmonics::project(&lit(4.0 * (1.0 + column), PROBE_MAP)).coefficients;
            let truth: Vec<f32> = truth.iter().flat_map(|rgb| [0, 1, 2].map(|c| rgb[c] / colour[c])).collect();
            let size = (truth.iter().map(|v| v * v).sum::<f32>() / truth.len() as f32).sqrt() + DARK;
            let even = 2.0 * std::f32::consts::PI.sqrt();
            let square = |(i, v): (usize, &f32)| ((if i < 3 { even } else { 0.0 } - v) / size).powi(2);
            truth.iter().enumerate().map(square).sum::<f32>() / truth.len() as f32
        };
        let expected = 0.5 * (error(1.0) + error(5.0));
        let got = loss.values()[0].1;
        assert!((got / expected - 1.0).abs() < 1e-4, "{got} {expected}");
    }

    #[test]
    fn gradients_equal_finite_differences() {
        let truth = values(3 * 8, 4);
        let got = Tensor::<2>::from_data(TensorData::new(values(3 * 8, 1), [3, 8]), &Device::flex());
        assert_gradient(got, |got| {
            let truth = Tensor::<2>::from_data(TensorData::new(truth.clone(), [3, 8]), (&got.device(), got.dtype()));
            relative_error(got, truth)
        });
    }
}
