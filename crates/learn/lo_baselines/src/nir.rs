//! Sengupta et al. 2019, "Neural inverse rendering": albedo, normals and one panorama, trained through their rendering.

use std::f32::consts::PI;

use burn::module::Module;
use burn::nn::conv::Conv2d;
use burn::tensor::{Device, Tensor, TensorData, activation};
use lo_geometry::pixel_solid_angle_sr;
use lo_imaging::{RadianceImage, resize_equirectangular};
use lo_nets::conv::conv2d;
use lo_nets::depth::{conv, panorama_image, panorama_loss};
use lo_random::Stream;

use crate::deeplight;
use crate::dense::{CELL_CHANNELS, Cells, DenseDecoder};
use crate::example::{BaselineExample, PROBE_MAP};
use crate::features::{FeatureBatch, FeatureShape};
use crate::gaussians::directions;
use crate::global::{GlobalPath, MapNet};
use crate::losses::{Losses, Term};
use crate::planes::Planes;

/// Every how many cells one is rendered, which is enough for the panorama's gradient.
const RENDERED: usize = 4;

/// Network of Sengupta et al. 2019.
#[derive(Module, Debug)]
pub struct NirNet {
    /// Decoder of the panorama.
    pub map: MapNet,
    /// Decoder of the cells' features.
    pub dense: DenseDecoder,
    /// Albedo, normal, and what direct rendering leaves of the photo: nine channels.
    pub surface: Conv2d,
}

/// Predicted surfaces of all cells, `[3, images, rows, columns]` each.
struct Surfaces {
    albedo: Tensor<4>,
    normal: Tensor<4>,
    residual: Tensor<4>,
}

impl NirNet {
    pub(crate) fn new(shape: FeatureShape, stream: &mut Stream, device: &Device) -> Self {
        Self {
            map: MapNet::new(shape, &deeplight::CHANNELS, 3, stream, device),
            dense: DenseDecoder::new(shape, GlobalPath::length(shape), stream, device),
            surface: conv([CELL_CHANNELS, 9], 3, 1, true, stream, device),
        }
    }

    fn surfaces(&self, batch: &FeatureBatch, global: Tensor<2>) -> Surfaces {
        let outputs = conv2d(self.dense.forward(batch, global), &self.surface);
        let part = |index: usize| outputs.clone().narrow(0, 3 * index, 3);
        let normal = part(1);
        let length = (normal.clone().square().sum_dim(0) + 1e-4).sqrt();
        Surfaces { albedo: activation::sigmoid(part(0)), normal: normal / length, residual: part(2) * 0.1 }
    }

    pub(crate) fn losses(&self, batch: &FeatureBatch, examples: &[&BaselineExample]) -> Losses {
        let device = batch.global.device();
        let global = self.map.global.forward(batch);
        let map = self.map.decoder.forward(global.clone());
        let Surfaces { albedo, normal, residual } = self.surfaces(batch, global);
        let planes = |of: fn(&BaselineExample) -> &Planes| {
            Planes::stack(&examples.iter().map(|example| of(example)).collect::<Vec<_>>(), &device)
        };
        let truth = [planes(|example| &example.albedo), planes(|example| &example.normal)];
        let off = |got: Tensor<4>, truth: &Tensor<4>| {
            // Zero where unknown.
            let known = truth.clone().abs().sum_dim(0).greater_elem(1e-3).float();
            let count = known.clone().sum() * 3.0 + 1.0;
            ((got - truth.clone()).abs() * known).sum() / count
        };
        let [width, height] = PROBE_MAP;
        let maps: Vec<RadianceImage> =
            examples.iter().map(|example| resize_equirectangular(&example.panorama, width, height)).collect();
        let truths: Vec<Option<&RadianceImage>> = maps.iter().map(Some).collect();
        let [log, ..] = panorama_loss(map.clone(), &truths);
        let cells = rendered_cells(examples);
        let at = |x: &Tensor<4>| cells.of(x.clone());
        let shading = shading(&map, at(&normal), &cells);
        let rendered = at(&albedo) * shading + at(&residual);
        let photo = (rendered.clamp_max(1.0) - at(&batch.photo)).abs().mean();
        Losses::new([
            Term::new("albedo", off(albedo, &truth[0]), 1.0),
            Term::new("normal", off(normal, &truth[1]), 1.0),
            Term::new("panorama", log, 1.0),
            Term::new("photo", photo, 0.5),
            // What direct light explains must not be left to the residual.
            Term::new("residual", residual.abs().mean(), 0.05),
        ])
    }

    pub(crate) fn predict(&self, batch: &FeatureBatch) -> RadianceImage {
        panorama_image(self.map.radiance(batch))
    }
}

/// Returns some of the shown cells of all photos, in a regular pattern.
fn rendered_cells(examples: &[&BaselineExample]) -> Cells {
    let of_image = |(image, example): (usize, &&BaselineExample)| {
        let [rows, columns] = example.features.shown;
        let cells = (0..rows).flat_map(move |row| (0..columns).map(move |column| [image, row, column]));
        cells.filter(|[_, row, column]| (2 * row + column).is_multiple_of(RENDERED)).collect::<Vec<_>>()
    };
    Cells { at: examples.iter().enumerate().flat_map(of_image).collect() }
}

/// Returns irradiance over π on surfaces with `normals[cells, 3]` under their image's panorama, `[cells, 3]`.
fn shading(map: &Tensor<4>, normals: Tensor<2>, cells: &Cells) -> Tensor<2> {
    let [_, images, height, width] = map.dims();
    let (device, dtype, pixels) = (map.device(), map.dtype(), height * width);
    let constant =
        |values: Vec<f32>, size: [usize; 2]| Tensor::<2>::from_data(TensorData::new(values, size), (&device, dtype));
    let cosines = activation::relu(normals.matmul(constant(directions([width, height]), [3, pixels])));
    let share = (0..pixels).map(|i| pixel_solid_angle_sr(i / width, width, height) / PI).collect();
    let light = map.clone().reshape([3, images, pixels]) * constant(share, [1, pixels]).reshape([1, 1, pixels]);
    // Cells are ordered by image, and each image is one product.
    let mut begin = 0;
    let parts = cells.at.chunk_by(|a, b| a[0] == b[0]).map(|own| {
        let light = light.clone().narrow(1, own[0][0], 1).reshape([3, pixels]).swap_dims(0, 1);
        begin += own.len();
        cosines.clone().narrow(0, begin - own.len(), own.len()).matmul(light)
    });
    Tensor::cat(parts.collect(), 0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{assert_gradient, numbers, values};

    #[test]
    fn shading_is_the_closed_form_of_a_linear_sky() {
        // L = a + b·ω: E / π = a + 2/3 b·n.
        let skies = [(1.0f32, [0.5f32, -0.25, 0.25]), (0.4, [-0.1, 0.2, 0.3])];
        let directions = directions([32, 16]);
        let value = |image: usize, pixel: usize| {
            let (a, b) = skies[image];
            a + (0..3).map(|k| b[k] * directions[k * 512 + pixel]).sum::<f32>()
        };
        let map: Vec<f32> = (0..3 * 2 * 512).map(|i| value(i / 512 % 2, i % 512)).collect();
        let map = Tensor::<4>::from_data(TensorData::new(map, [3, 2, 16, 32]), &Device::flex());
        let normals = [[0.0f32, 1.0, 0.0], [0.6, 0.0, 0.8], [0.0, -0.6, -0.8]];
        let cells = Cells { at: vec![[0, 0, 0], [1, 0, 0], [1, 2, 3]] };
        let tensor = Tensor::<2>::from_data(TensorData::new(normals.concat(), [3, 3]), &Device::flex());
        let got = numbers(shading(&map, tensor, &cells));
        for (i, &[image, ..]) in cells.at.iter().enumerate() {
            let (a, b) = skies[image];
            let expected = a + 2.0 / 3.0 * (0..3).map(|k| b[k] * normals[i][k]).sum::<f32>();
            assert!((got[3 * i] - expected).abs() < 0.01, "{i}: {} {expected}", got[3 * i]);
        }
    }

    #[test]
    fn gradients_equal_finite_differences() {
        let cells = Cells { at: vec![[0, 0, 0], [0, 0, 1]] };
        let map = Tensor::<4>::from_data(TensorData::new(values(3 * 8, 1), [3, 1, 2, 4]), &Device::flex());
        let normals = Tensor::<2>::from_data(TensorData::new(values(6, 2), [2, 3]), &Device::flex());
        let like = |x: &Tensor<2>, map: &Tensor<4>| {
            Tensor::<2>::from_data(x.clone().into_data().convert::<f64>(), (&map.device(), map.dtype()))
        };
        assert_gradient(map.clone(), |map| shading(&map, like(&normals, &map), &cells).square().sum());
        assert_gradient(normals, |normals| {
            let map =
                Tensor::<4>::from_data(map.clone().into_data().convert::<f64>(), (&normals.device(), normals.dtype()));
            shading(&map, normals, &cells).square().sum()
        });
    }
}
