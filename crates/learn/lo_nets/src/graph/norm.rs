use burn::tensor::Tensor;
use rayon::prelude::*;

use crate::cpu_ops::{Kernel, Number, binary, ternary};

/// Rows of one partial sum. Fixed, so that results do not depend on the number of threads.
const BLOCK: usize = 1 << 8;

/// Added to variances, as in PyTorch.
const EPSILON: f64 = 1e-5;

/// Activation after a normalisation.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Activation {
    /// Identity.
    None,
    /// max(x, 0).
    Relu,
}

/// Normalises `x[nodes, channels]`, scales and shifts by the rows of `affine[2, channels]`, and activates.
///
/// Mean and variance are taken over all nodes, for each of `groups` groups of adjacent channels. One group a channel is
/// batch normalisation in training mode; fewer groups are group normalisation.
///
/// # Panics
/// Where `groups` does not divide the channels.
pub fn normalise(x: Tensor<2>, affine: Tensor<2>, groups: usize, activation: Activation) -> Tensor<2> {
    let kernel = NormKernel { groups, activation };
    binary(x, affine, kernel)
}

/// Adds `skip[nodes, channels]` between normalisation and activation of [`normalise`].
pub fn normalise_and_add(
    x: Tensor<2>,
    affine: Tensor<2>,
    skip: Tensor<2>,
    groups: usize,
    activation: Activation,
) -> Tensor<2> {
    let kernel = NormKernel { groups, activation };
    ternary(x, affine, skip, kernel)
}

/// Reference implementation with burn's operations.
#[cfg(test)]
fn composed(x: Tensor<2>, affine: Tensor<2>, skip: Option<Tensor<2>>, kernel: NormKernel) -> Tensor<2> {
    let [nodes, channels] = x.dims();
    let (groups, per_group) = (kernel.groups, channels / kernel.groups);
    // [groups, everything that is averaged]
    let grouped = x.reshape([nodes, groups, per_group]).swap_dims(0, 1).reshape([groups, nodes * per_group]);
    let centred = grouped.clone() - grouped.mean_dim(1);
    let variance = centred.clone().square().mean_dim(1);
    let unit = centred / (variance + EPSILON).sqrt();
    let unit = unit.reshape([groups, nodes, per_group]).swap_dims(0, 1).reshape([nodes, channels]);
    let mut y = unit * affine.clone().narrow(0, 0, 1) + affine.narrow(0, 1, 1);
    if let Some(skip) = skip {
        y = y + skip;
    }
    match kernel.activation {
        Activation::None => y,
        Activation::Relu => burn::tensor::activation::relu(y),
    }
}

/// [`normalise`] on slices.
#[derive(Clone, Copy, Debug)]
struct NormKernel {
    groups: usize,
    activation: Activation,
}

/// Mean and reciprocal standard deviation of each channel; equal for the channels of a group.
struct ChannelStatistics<T> {
    mean: Vec<T>,
    inverse_deviation: Vec<T>,
}

/// Count, mean and sum of squared differences from the mean.
#[derive(Clone, Copy, Default)]
struct PartialMoments {
    count: f64,
    mean: f64,
    squares: f64,
}

impl PartialMoments {
    /// Merges the moments of two sets (Chan et al. 1979).
    fn merged(self, other: Self) -> Self {
        let count = self.count + other.count;
        if count == 0.0 {
            return self;
        }
        let difference = other.mean - self.mean;
        Self {
            count,
            mean: self.mean + difference * other.count / count,
            squares: self.squares + other.squares + difference * difference * self.count * other.count / count,
        }
    }
}

impl NormKernel {
    fn statistics<T: Number>(&self, x: &[T], channels: usize) -> ChannelStatistics<T> {
        let blocks: Vec<Vec<PartialMoments>> =
            x.par_chunks(BLOCK * channels).map(|x| block_moments(x, channels)).collect();
        let mut moments = vec![PartialMoments::default(); channels];
        for block in blocks {
            moments.iter_mut().zip(block).for_each(|(sum, block)| *sum = sum.merged(block));
        }
        let per_group = channels / self.groups;
        let (mut mean, mut inverse_deviation) = (Vec::with_capacity(channels), Vec::with_capacity(channels));
        for group in moments.chunks_exact(per_group) {
            let whole = group.iter().fold(PartialMoments::default(), |sum, &channel| sum.merged(channel));
            let deviation = (whole.squares / whole.count.max(1.0) + EPSILON).sqrt();
            mean.extend(std::iter::repeat_n(T::from_f64(whole.mean), per_group));
            inverse_deviation.extend(std::iter::repeat_n(T::from_f64(1.0 / deviation), per_group));
        }
        ChannelStatistics { mean, inverse_deviation }
    }

    /// Returns scale and shift of the normalisation: the output is `scale · x + shift`, plus `skip`, activated.
    fn scale_and_shift<T: Number>(statistics: &ChannelStatistics<T>, affine: &[T]) -> (Vec<T>, Vec<T>) {
        let (gain, bias) = affine.split_at(affine.len() / 2);
        let scale: Vec<T> = gain.iter().zip(&statistics.inverse_deviation).map(|(&g, &d)| g * d).collect();
        let shift = bias.iter().zip(&scale).zip(&statistics.mean).map(|((&b, &s), &m)| b - s * m).collect();
        (scale, shift)
    }

    fn check(&self, sizes: &[[usize; 2]]) -> usize {
        let [_, channels] = sizes[0];
        assert!(
            self.groups > 0 && channels.is_multiple_of(self.groups),
            "{} groups of {channels} channels",
            self.groups
        );
        assert_eq!(sizes[1], [2, channels], "a scale and a shift for each channel");
        assert!(sizes.len() < 3 || sizes[2] == sizes[0], "the skip input has the input's size");
        channels
    }
}

impl Kernel for NormKernel {
    fn output_size(&self, sizes: &[[usize; 2]]) -> [usize; 2] {
        self.check(sizes);
        sizes[0]
    }

    fn forward<T: Number>(&self, inputs: &[&[T]], sizes: &[[usize; 2]]) -> Vec<T> {
        let channels = self.check(sizes);
        let (scale, shift) = Self::scale_and_shift(&self.statistics(inputs[0], channels), inputs[1]);
        let mut output = vec![T::default(); inputs[0].len()];
        let relu = self.activation == Activation::Relu;
        output.par_chunks_mut(BLOCK * channels).enumerate().for_each(|(block, output)| {
            let range = block * BLOCK * channels..block * BLOCK * channels + output.len();
            let x = inputs[0][range.clone()].chunks_exact(channels);
            for (output, x) in output.chunks_exact_mut(channels).zip(x) {
                for ((y, &x), (&scale, &shift)) in output.iter_mut().zip(x).zip(scale.iter().zip(&shift)) {
                    *y = scale * x + shift;
                }
            }
            if let Some(skip) = inputs.get(2) {
                output.iter_mut().zip(&skip[range]).for_each(|(y, &skip)| *y += skip);
            }
            if relu {
                output.iter_mut().for_each(|y| *y = positive(*y));
            }
        });
        output
    }

    fn backward<T: Number>(&self, inputs: &[&[T]], sizes: &[[usize; 2]], gradient: &[T], _: &[bool]) -> Vec<Vec<T>> {
        let channels = self.check(sizes);
        let statistics = self.statistics(inputs[0], channels);
        let (scale, shift) = Self::scale_and_shift(&statistics, inputs[1]);
        // The gradient before the activation, with its sums alone and multiplied by the centred input.
        let mut pre_activation = gradient.to_vec();
        let blocks: Vec<[Vec<T>; 2]> = pre_activation
            .par_chunks_mut(BLOCK * channels)
            .enumerate()
            .map(|(block, pre_activation)| {
                let start = block * BLOCK * channels;
                let x = &inputs[0][start..start + pre_activation.len()];
                if self.activation == Activation::Relu {
                    let skip = inputs.get(2).map(|skip| &skip[start..start + pre_activation.len()]);
                    clear_inactive(pre_activation, x, skip, &scale, &shift);
                }
                block_sums(pre_activation, x, &statistics.mean, channels)
            })
            .collect();
        let (mut sum, mut with_x) = (vec![0.0; channels], vec![0.0; channels]);
        for [block_sum, block_with_x] in &blocks {
            sum.iter_mut().zip(block_sum).for_each(|(total, &value)| *total += value.as_f64());
            with_x.iter_mut().zip(block_with_x).for_each(|(total, &value)| *total += value.as_f64());
        }
        let (gain, deviation) = (&inputs[1][..channels], &statistics.inverse_deviation);
        let by_gain: Vec<f64> = (0..channels).map(|c| with_x[c] * deviation[c].as_f64()).collect();
        let by_affine = by_gain.iter().chain(&sum).map(|&value| T::from_f64(value)).collect();
        // Gradient of x: scale · gradient, less the parts through the mean and the variance.
        let per_group = channels / self.groups;
        let count = (sizes[0][0] * per_group).max(1) as f64;
        let (mut slope, mut constant) = (Vec::with_capacity(channels), Vec::with_capacity(channels));
        for group in 0..self.groups {
            let members = group * per_group..(group + 1) * per_group;
            let mean: f64 = members.clone().map(|c| gain[c].as_f64() * sum[c]).sum::<f64>() / count;
            let with_unit: f64 = members.clone().map(|c| gain[c].as_f64() * by_gain[c]).sum::<f64>() / count;
            for c in members {
                let d = deviation[c].as_f64();
                slope.push(T::from_f64(-d * d * with_unit));
                constant.push(T::from_f64(-d * mean + d * d * with_unit * statistics.mean[c].as_f64()));
            }
        }
        let mut by_input = vec![T::default(); gradient.len()];
        by_input.par_chunks_mut(BLOCK * channels).enumerate().for_each(|(block, by_input)| {
            let start = block * BLOCK * channels;
            let rows = pre_activation[start..].chunks_exact(channels).zip(inputs[0][start..].chunks_exact(channels));
            for (out, (gradient, x)) in by_input.chunks_exact_mut(channels).zip(rows) {
                let factors = scale.iter().zip(&slope).zip(&constant);
                for (((out, &g), &x), ((&scale, &slope), &constant)) in out.iter_mut().zip(gradient).zip(x).zip(factors)
                {
                    *out = scale * g + slope * x + constant;
                }
            }
        });
        vec![by_input, by_affine, pre_activation]
    }
}

/// Keeps NaN, so that it is noticed.
fn positive<T: Number>(value: T) -> T {
    if value < T::default() { T::default() } else { value }
}

fn block_moments<T: Number>(x: &[T], channels: usize) -> Vec<PartialMoments> {
    let count = x.len() / channels;
    let share: T = T::from_f64(1.0 / count as f64);
    let mut mean = vec![T::default(); channels];
    for row in x.chunks_exact(channels) {
        mean.iter_mut().zip(row).for_each(|(sum, &x)| *sum += x);
    }
    mean.iter_mut().for_each(|sum| *sum *= share);
    let mut squares = vec![T::default(); channels];
    for row in x.chunks_exact(channels) {
        for ((sum, &x), &mean) in squares.iter_mut().zip(row).zip(&mean) {
            *sum += (x - mean) * (x - mean);
        }
    }
    let both = mean.into_iter().zip(squares);
    both.map(|(mean, squares)| PartialMoments { count: count as f64, mean: mean.as_f64(), squares: squares.as_f64() })
        .collect()
}

/// Clears the gradient where the activation is 0.
fn clear_inactive<T: Number>(gradient: &mut [T], x: &[T], skip: Option<&[T]>, scale: &[T], shift: &[T]) {
    let channels = scale.len();
    for (row, (gradient, x)) in gradient.chunks_exact_mut(channels).zip(x.chunks_exact(channels)).enumerate() {
        // The same operations in the same order as forward, so that signs agree.
        let linear = gradient.iter_mut().zip(x).zip(scale.iter().zip(shift));
        let clear = |gradient: &mut T, y: T| *gradient = if y > T::default() { *gradient } else { T::default() };
        match skip {
            None => linear.for_each(|((gradient, &x), (&scale, &shift))| clear(gradient, scale * x + shift)),
            Some(skip) => {
                for (((gradient, &x), (&scale, &shift)), &skip) in linear.zip(&skip[row * channels..]) {
                    clear(gradient, scale * x + shift + skip);
                }
            }
        }
    }
}

/// Sums the gradient, and the gradient times the centred input, for each channel.
fn block_sums<T: Number>(gradient: &[T], x: &[T], mean: &[T], channels: usize) -> [Vec<T>; 2] {
    let (mut sum, mut with_x) = (vec![T::default(); channels], vec![T::default(); channels]);
    for (gradient, x) in gradient.chunks_exact(channels).zip(x.chunks_exact(channels)) {
        let sums = sum.iter_mut().zip(with_x.iter_mut());
        for (((sum, with_x), (&g, &x)), &mean) in sums.zip(gradient.iter().zip(x)).zip(mean) {
            *sum += g;
            *with_x += g * (x - mean);
        }
    }
    [sum, with_x]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{assert_gradients, assert_same_function};

    #[test]
    fn kernel_equals_reference() {
        for (groups, activation) in [(6, Activation::Relu), (2, Activation::Relu), (3, Activation::None)] {
            let kernel = NormKernel { groups, activation };
            let got = |[x, a]: [Tensor<2>; 2]| normalise(x, a, groups, activation);
            assert_same_function(&[[600, 6], [2, 6]], got, |[x, a]| composed(x, a, None, kernel));
            let got = |[x, a, s]: [Tensor<2>; 3]| normalise_and_add(x, a, s, groups, activation);
            assert_same_function(&[[600, 6], [2, 6], [600, 6]], got, |[x, a, s]| composed(x, a, Some(s), kernel));
        }
    }

    #[test]
    fn gradients_equal_finite_differences() {
        assert_gradients(&[[40, 6], [2, 6]], |[x, a]| normalise(x, a, 2, Activation::None));
        assert_gradients(&[[40, 6], [2, 6], [40, 6]], |[x, a, s]| normalise_and_add(x, a, s, 6, Activation::Relu));
    }

    #[test]
    fn variance_is_accurate_at_large_means() {
        let x: Vec<f32> = (0..3000).map(|i| 3000.0 + (i as f32 * 0.7).sin()).collect();
        let kernel = NormKernel { groups: 1, activation: Activation::None };
        let y = kernel.forward(&[&x, &[1.0, 0.0]], &[[3000, 1], [2, 1]]);
        let square = y.iter().map(|y| f64::from(*y).powi(2)).sum::<f64>() / 3000.0;
        assert!((square - 1.0).abs() < 1e-3, "{square}");
    }
}
