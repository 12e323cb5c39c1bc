//! Srinivasan et al. 2020, "Lighthouse": a dense volume of radiance and opacity, completed by a 3D U-Net and volume
//! rendered.

use burn::module::Module;
use burn::nn::conv::Conv2d;
use burn::tensor::{Device, Tensor, TensorData, activation, activation::relu, module::adaptive_avg_pool2d};
use lo_geometry::{Vec3, pixel_direction};
use lo_imaging::RadianceImage;
use lo_nets::conv::{conv2d, upsample_nearest};
use lo_nets::depth::{conv, panorama_loss};
use lo_nets::layers::Linear;
use lo_random::Stream;

use crate::example::{BaselineExample, PROBE_MAP};
use crate::features::{FeatureBatch, FeatureShape, PhotoFeatures};
use crate::global::GlobalPath;
use crate::losses::{Losses, Term};
use crate::volume::{Grid, Volume, VoxelRay, render};

/// Voxels along an edge.
const SIDE: usize = 64;

/// Channels of the U-Net from 64³ to 8³ voxels.
const CHANNELS: [usize; 4] = [8, 16, 32, 64];

/// Input channels of a voxel: log colour relative to the photo's mean, whether a surface is seen in it, whether it is
/// seen to be empty.
const INPUTS: usize = 5;

/// Share of the predicted surface points that the volume holds; the others are at its sides. Half the volume's edge is
/// this multiple of their largest coordinate.
const INSIDE: f32 = 0.95;
const MARGIN: f32 = 1.2;

/// Smallest half edge, metres.
const MIN_HALF_EDGE_M: f32 = 1.5;

/// Depth beyond the predicted one, relative to it, up to which a voxel is neither empty nor hidden.
const SURFACE: f32 = 0.05;

/// Smallest radiance relative to the photo's mean before logarithms.
const DARK: f32 = 0.02;

/// Logit of the opacity of voxels at the beginning, and what a seen surface adds to it.
const CLEAR: f64 = -3.5;
const SEEN: f64 = 5.0;

/// Largest log radiance relative to the photo's mean.
const MAX_LOG: f64 = 7.0;

/// Probes of a photo that a step renders.
const RENDERED: usize = 5;

/// Network of Srinivasan et al. 2020.
#[derive(Module, Debug)]
pub struct LighthouseNet {
    /// Global vector.
    pub global: GlobalPath,
    /// From the global vector to channels of the coarsest voxels.
    pub everywhere: Linear,
    /// Convolutions from fine to coarse.
    pub down: Vec<Conv2d>,
    /// Convolutions from coarse to fine.
    pub up: Vec<Conv2d>,
    /// Convolution to log radiance and logit of opacity.
    pub output: Conv2d,
}

impl LighthouseNet {
    pub(crate) fn new(shape: FeatureShape, stream: &mut Stream, device: &Device) -> Self {
        // Three neighbouring slices side by side make a convolution of images one of volumes.
        let mut cubic = |inputs: usize, outputs: usize| conv([3 * inputs, outputs], 3, 1, true, stream, device);
        let down = CHANNELS.iter().scan(INPUTS, |inputs, &outputs| {
            let layer = cubic(*inputs, outputs);
            *inputs = outputs;
            Some(layer)
        });
        let down = down.collect();
        let up = CHANNELS.windows(2).rev().map(|pair| cubic(pair[0] + pair[1], pair[0])).collect();
        let global = GlobalPath::new(shape, stream, device);
        let everywhere = Linear::with_bias([GlobalPath::length(shape), CHANNELS[3]], stream, device);
        Self { global, everywhere, down, up, output: conv([CHANNELS[0], 4], 1, 1, true, stream, device) }
    }

    /// Returns the volume of one photo, `[4, side³]`: radiance relative to the photo's mean colour, opacity.
    fn forward(&self, batch: &FeatureBatch, input: Tensor<4>) -> Tensor<2> {
        let [_, side, ..] = input.dims();
        let global = relu(self.everywhere.forward(self.global.forward(batch)));
        let (mut x, mut skips) = (input.clone(), Vec::new());
        for (level, layer) in self.down.iter().enumerate() {
            if level > 0 {
                skips.push(x.clone());
                x = halved(x);
            }
            x = relu(conv2d(slices(x), layer));
        }
        // One vector for all of the coarsest voxels.
        x = x + global.reshape([CHANNELS[3], 1, 1, 1]);
        for layer in &self.up {
            let skip = skips.pop().expect("as many levels up as down");
            x = relu(conv2d(slices(Tensor::cat(vec![doubled(x), skip], 0)), layer));
        }
        let output = conv2d(x, &self.output);
        let seen = input.clone().narrow(0, 3, 1);
        let log = output.clone().narrow(0, 0, 3) + input.narrow(0, 0, 3) * seen.clone();
        let opacity = activation::sigmoid(output.narrow(0, 3, 1) + seen * SEEN + CLEAR);
        Tensor::cat(vec![log.clamp_max(MAX_LOG).exp(), opacity], 0).reshape([4, side * side * side])
    }

    /// Returns the losses, one photo after the other.
    pub(crate) fn losses(&self, batch: &FeatureBatch, examples: &[&BaselineExample], progress: f32) -> Losses {
        let device = batch.global.device();
        let mut sums: Option<[Tensor<1>; 2]> = None;
        for (image, example) in examples.iter().enumerate() {
            let grid = grid(&example.features);
            let input = Tensor::<4>::from_data(
                TensorData::new(volume_input(&example.features, grid), [INPUTS, SIDE, SIDE, SIDE]),
                &device,
            );
            let volume = self.forward(&batch.image(image), input);
            let probes = drawn(example, progress);
            let rays: Vec<VoxelRay> = probes.iter().flat_map(|(position, _)| rays(grid, *position)).collect();
            let [width, height] = PROBE_MAP;
            let maps = render(volume, SIDE, rays).reshape([probes.len(), height * width, 3]);
            let colour = batch.log_colour.clone().narrow(0, image, 1).exp().reshape([1, 1, 3]);
            let maps = (maps * colour).swap_dims(1, 2).swap_dims(0, 1).reshape([3, probes.len(), height, width]);
            let truths: Vec<Option<&RadianceImage>> = probes.iter().map(|(_, truth)| Some(*truth)).collect();
            let [log, tone, _] = panorama_loss(maps, &truths);
            sums = Some(match sums {
                None => [log, tone],
                Some([a, b]) => [a + log, b + tone],
            });
        }
        let [log, tone] = sums.expect("a batch has photos").map(|sum| sum / examples.len() as f32);
        Losses::new([Term::new("light", log, 1.0), Term::new("tone", tone, 2.0)])
    }

    /// Returns the volume of one photo.
    pub(crate) fn predict(&self, batch: &FeatureBatch, features: &PhotoFeatures) -> Volume {
        let grid = grid(features);
        let input = TensorData::new(volume_input(features, grid), [INPUTS, SIDE, SIDE, SIDE]);
        let volume = self.forward(batch, Tensor::<4>::from_data(input, &batch.global.device()));
        let colour = batch.log_colour.clone().exp().reshape([3, 1]);
        let opacity = Tensor::ones([1, 1], &batch.global.device());
        let volume = volume * Tensor::cat(vec![colour, opacity], 0);
        Volume { grid, values: volume.into_data().iter().collect() }
    }
}

/// Returns `x[channels, side, side, side]` with the slices before and after each beside it: `[3 · channels, …]`.
fn slices(x: Tensor<4>) -> Tensor<4> {
    let count = x.dims()[1];
    let outside = x.clone().narrow(1, 0, 1).zeros_like();
    let before = Tensor::cat(vec![outside.clone(), x.clone().narrow(1, 0, count - 1)], 1);
    let after = Tensor::cat(vec![x.clone().narrow(1, 1, count - 1), outside], 1);
    Tensor::cat(vec![before, x, after], 0)
}

/// Averages 2 × 2 × 2 voxels.
fn halved(x: Tensor<4>) -> Tensor<4> {
    let [channels, slices, rows, columns] = x.dims();
    let x = adaptive_avg_pool2d(x, [rows / 2, columns / 2]);
    let x = x.reshape([channels, slices / 2, 2, rows * columns / 4]).mean_dim(2);
    x.reshape([channels, slices / 2, rows / 2, columns / 2])
}

/// Repeats each voxel 2 × 2 × 2 times.
fn doubled(x: Tensor<4>) -> Tensor<4> {
    let x = upsample_nearest(x, None);
    let [channels, slices, rows, columns] = x.dims();
    let x = x.reshape([channels, slices, 1, rows * columns]).expand([channels, slices, 2, rows * columns]);
    x.reshape([channels, 2 * slices, rows, columns])
}

/// Places the volume around the camera.
fn grid(features: &PhotoFeatures) -> Grid {
    let mut reach: Vec<f32> = features.surface().iter().map(|(_, point)| point.abs().max_element()).collect();
    reach.sort_by(f32::total_cmp);
    let most = reach[((reach.len() - 1) as f32 * INSIDE) as usize];
    Grid::around_camera((MARGIN * most).max(MIN_HALF_EDGE_M), SIDE)
}

/// Returns the network's input, `[INPUTS, side³]`: what the photo shows of each voxel.
fn volume_input(features: &PhotoFeatures, grid: Grid) -> Vec<f32> {
    let voxels = grid.side.pow(3);
    let mut input = vec![0.0; INPUTS * voxels];
    let length = features.global.len();
    let mean = [3, 2, 1].map(|from_end| features.global[length - from_end]);
    let mut counts = vec![0.0f32; voxels];
    for ([row, column], point) in features.surface() {
        let index = grid.index(point);
        counts[index] += 1.0;
        for c in 0..3 {
            input[c * voxels + index] += features.photo.at(c, row, column).max(0.0);
        }
    }
    let view = ShownCells::new(features);
    for (index, &count) in counts.iter().enumerate() {
        if count > 0.0 {
            for c in 0..3 {
                let value = input[c * voxels + index] / count;
                input[c * voxels + index] = (value / mean[c].exp()).max(DARK).ln();
            }
            input[3 * voxels + index] = 1.0;
        } else if view.is_empty_at(grid.middle_m(index)) {
            input[4 * voxels + index] = 1.0;
        }
    }
    input
}

/// The shown cells as a pinhole camera, recovered from their surface points.
struct ShownCells<'a> {
    features: &'a PhotoFeatures,
    /// Column and row are `scale · slope + offset`, with the slopes x ÷ −z and y ÷ −z.
    columns: [f32; 2],
    rows: [f32; 2],
}

impl<'a> ShownCells<'a> {
    fn new(features: &'a PhotoFeatures) -> Self {
        let [rows, columns] = features.shown;
        let line = |count: usize, slope: &dyn Fn(usize) -> f32| {
            let (first, last) = (slope(0), slope(count - 1));
            let scale = if count > 1 { (count - 1) as f32 / (last - first) } else { 0.0 };
            [scale, -scale * first]
        };
        let point = |row: usize, column: usize| features.points_m.vector(row, column);
        let across = |column: usize| point(0, column).x / -point(0, column).z;
        let down = |row: usize| point(row, 0).y / -point(row, 0).z;
        Self { features, columns: line(columns, &across), rows: line(rows, &down) }
    }

    /// Whether the photo sees through a position to a surface behind it.
    fn is_empty_at(&self, position_m: Vec3) -> bool {
        let depth_m = -position_m.z;
        if depth_m <= 0.0 {
            return false;
        }
        let at = |[scale, offset]: [f32; 2], slope: f32, count: usize| {
            let place = (scale * slope + offset).round();
            (0.0..count as f32).contains(&place).then_some(place as usize)
        };
        let [rows, columns] = self.features.shown;
        let cell = (at(self.rows, position_m.y / depth_m, rows), at(self.columns, position_m.x / depth_m, columns));
        let (Some(row), Some(column)) = cell else { return false };
        depth_m < (1.0 - SURFACE) * -self.features.points_m.at(2, row, column)
    }
}

/// Returns some probes of an example, others at each step: position and truth.
fn drawn(example: &BaselineExample, progress: f32) -> Vec<(Vec3, &RadianceImage)> {
    let probes = &example.probes;
    let begin = lo_random::hash(&progress.to_le_bytes()) as usize % probes.len().max(1);
    let some = (0..RENDERED.min(probes.len())).map(|i| &probes[(begin + i) % probes.len()]);
    some.map(|probe| (probe.position_m, &probe.radiance)).collect()
}

/// Returns the rays of a probe's panorama.
fn rays(grid: Grid, position_m: Vec3) -> impl Iterator<Item = VoxelRay> {
    let ([width, height], origin) = (PROBE_MAP, grid.voxels(position_m));
    (0..width * height).map(move |i| [origin, pixel_direction(i % width, i / width, width, height)])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::planes::Planes;
    use crate::testing::{SHAPE, example, numbers, values};

    /// A photo of a wall at 2 m in front of the camera, whose cells are 0.25 m apart.
    fn wall() -> PhotoFeatures {
        let points_m = Planes::from_fn([3, 4, 8], |axis, row, column| match axis {
            0 => 0.25 * column as f32 - 0.875,
            1 => 0.375 - 0.25 * row as f32,
            _ => -2.0,
        });
        PhotoFeatures { points_m, ..example(1).features }
    }

    #[test]
    fn voxels_know_what_the_photo_shows_of_them() {
        let features = wall();
        let grid = grid(&features);
        assert!((grid.corner_m - Vec3::splat(-2.4)).length() < 1e-5);
        let input = volume_input(&features, grid);
        let voxels = SIDE.pow(3);
        let at = |channel: usize, position: Vec3| input[channel * voxels + grid.index(position)];
        let cell = Vec3::new(0.25 * 2.0 - 0.875, 0.375 - 0.25, -2.0);
        assert_eq!((at(3, cell), at(4, cell)), (1.0, 0.0));
        let expected = (features.photo.at(1, 1, 2) / (-1.1f32).exp()).ln();
        assert!((at(1, cell) - expected).abs() < 1e-5);
        // In front of the wall it is empty; behind it, beside the photo and behind the camera nothing is known.
        let empty = |position| (at(3, position), at(4, position));
        assert_eq!(empty(Vec3::new(0.1, 0.0, -1.0)), (0.0, 1.0));
        for unknown in [Vec3::new(0.1, 0.1, -2.3), Vec3::new(1.5, 0.0, -1.0), Vec3::new(0.0, 0.0, 1.0)] {
            assert_eq!(empty(unknown), (0.0, 0.0), "{unknown}");
        }
        assert_eq!((0..voxels).filter(|&i| input[3 * voxels + i] > 0.0).count(), 32);
    }

    #[test]
    fn slices_make_a_convolution_of_volumes() {
        let (side, device) = (4, Device::flex());
        let x = Tensor::<4>::from_data(TensorData::new(values(2 * 64, 1), [2, side, side, side]), &device);
        let layer = conv([6, 3], 3, 1, true, &mut lo_random::stream(1, "test", 0), &device);
        let got = numbers(conv2d(slices(x.clone()), &layer));
        let (x, weights) = (numbers(x), numbers(layer.weight.val()));
        for (output, z, y, column) in [(0, 0, 0, 0), (1, 2, 1, 3), (2, 3, 3, 2)] {
            let mut expected = 0.0;
            for (dz, channel, dy, dx) in
                (0..3).flat_map(|a| (0..2).flat_map(move |b| (0..9).map(move |c| (a, b, c / 3, c % 3))))
            {
                let at = [z + dz, y + dy, column + dx];
                if at.iter().any(|&v| v < 1 || v > side) {
                    continue;
                }
                let voxel = ((channel * side + at[0] - 1) * side + at[1] - 1) * side + at[2] - 1;
                expected += x[voxel] * weights[((output * 6 + dz * 2 + channel) * 3 + dy) * 3 + dx];
            }
            let found = got[((output * side + z) * side + y) * side + column];
            assert!((found - expected).abs() < 1e-5, "{found} {expected}");
        }
        let ones = Tensor::<4>::from_data(TensorData::new(values(64, 2), [1, 4, 4, 4]), &device);
        assert_eq!(numbers(halved(doubled(ones.clone()))), numbers(ones));
    }

    #[test]
    fn an_untrained_network_shows_what_the_photo_shows() {
        let features = wall();
        let net = LighthouseNet::new(SHAPE, &mut lo_random::stream(1, "test", 0), &Device::flex());
        let volume = net.predict(&FeatureBatch::new(&[&features], &Device::flex()), &features);
        let opacity = |position: Vec3| volume.values[3 * SIDE.pow(3) + volume.grid.index(position)];
        let (cell, air) = (Vec3::new(0.25 * 2.0 - 0.875, 0.375 - 0.25, -2.0), Vec3::new(0.1, 0.0, -1.0));
        assert!(opacity(cell) > 0.6 && opacity(air) < 0.4, "{} {}", opacity(cell), opacity(air));
    }
}
