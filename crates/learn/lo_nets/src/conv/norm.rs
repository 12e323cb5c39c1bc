use burn::nn::{BatchNorm, GroupNorm};
use burn::tensor::Tensor;
use pulp::{Arch, Simd, WithSimd};
use rayon::prelude::*;

use crate::conv::activation::total;
use crate::cpu_ops::{Kernel, Number, unary, zeros};
use crate::gemm::LANES;

/// Mean and variance of each channel, over all images or for each image.
///
/// The layers of a dense block share the moments of their common input channels.
#[derive(Clone, Debug)]
pub struct ChannelMoments {
    /// `[2, channels]` or `[2, channels · images]`.
    values: Tensor<2>,
    /// Number of pixels.
    count: usize,
}

impl ChannelMoments {
    /// Computes moments over all images of `x[channels, images, height, width]`.
    pub fn new(x: Tensor<4>) -> Self {
        let [channels, images, height, width] = x.dims();
        Self::of_rows(x, [channels, images * height * width])
    }

    /// Computes moments of each image of `x[channels, images, height, width]`.
    pub fn per_image(x: Tensor<4>) -> Self {
        let [channels, images, height, width] = x.dims();
        Self::of_rows(x, [channels * images, height * width])
    }

    fn of_rows(x: Tensor<4>, [rows, count]: [usize; 2]) -> Self {
        let x = x.reshape([rows, count]);
        let values = unary(x, MomentsKernel);
        Self { values, count }
    }

    /// Computes moments over all images of `x[channels, images, height, width]` where gradients are recorded.
    pub fn in_training(x: &Tensor<4>) -> Option<Self> {
        x.device().is_autodiff().then(|| Self::new(x.clone()))
    }

    /// Concatenates the channels of `self` and `other`.
    pub fn joined(self, other: Self) -> Self {
        Self { values: Tensor::cat(vec![self.values, other.values], 1), count: self.count }
    }

    /// Splits into mean and variance, one row each.
    fn parts(&self) -> [Tensor<2>; 2] {
        [0, 1].map(|row| self.values.clone().narrow(0, row, 1))
    }
}

/// Reference implementation with burn's operations.
#[cfg(test)]
fn composed(x: Tensor<2>) -> Tensor<2> {
    let mean = x.clone().mean_dim(1);
    let variance = (x - mean.clone()).square().mean_dim(1);
    Tensor::cat(vec![mean, variance], 1).transpose()
}

/// Batch normalisation as scale, centre and shift, `[3, channels]`.
///
/// Uses `moments` over all images while `norm` trains, and updates the running statistics by them. Otherwise uses the
/// running statistics.
pub fn batch_norm(norm: &BatchNorm, moments: Option<&ChannelMoments>) -> Tensor<2> {
    let [channels] = norm.gamma.dims();
    let row = |x: Tensor<1>| x.reshape([1, channels]);
    let [mean, variance] = match moments.filter(|_| norm.training.is_enabled()) {
        Some(moments) => {
            let parts = moments.parts();
            // Bessel's correction, as in PyTorch.
            let correction = moments.count as f64 / (moments.count.max(2) - 1) as f64;
            let states = [(&norm.running_mean, 1.0), (&norm.running_var, correction)];
            for ((state, factor), part) in states.into_iter().zip(&parts) {
                let new = part.clone().detach().reshape([channels]) * (norm.momentum * factor);
                let old = state.value_sync().to_device(&new.device()) * (1.0 - norm.momentum);
                state.update((old + new).detach());
            }
            parts
        }
        None => [&norm.running_mean, &norm.running_var].map(|state| row(state.value())),
    };
    affine([mean, variance], row(norm.gamma.val()), row(norm.beta.val()), norm.epsilon)
}

/// Group normalisation by the `moments` of each image, as scale, centre and shift, `[3, channels · images]`.
///
/// # Panics
/// Where the norm has no weights.
pub fn group_norm(norm: &GroupNorm, moments: &ChannelMoments) -> Tensor<2> {
    let (channels, groups) = (norm.num_channels, norm.num_groups);
    let [_, rows] = moments.values.dims();
    let size = [groups, channels / groups, rows / channels];
    let [mean, variance]: [Tensor<3>; 2] = moments.parts().map(|part| part.reshape(size));
    let group_mean = mean.clone().mean_dim(1);
    let variance = variance.mean_dim(1) + (mean - group_mean.clone()).square().mean_dim(1);
    let all = |x: Tensor<3>| x.expand(size).reshape([1, rows]);
    let [gain, bias] = [&norm.gamma, &norm.beta].map(|weights| {
        let weights = weights.as_ref().expect("a group norm with weights").val();
        weights.reshape([channels, 1]).expand([channels, rows / channels]).reshape([1, rows])
    });
    affine([all(group_mean), all(variance)], gain, bias, norm.epsilon)
}

/// Combines normalisation, gain and bias into the three rows of an affine map.
fn affine([mean, variance]: [Tensor<2>; 2], gain: Tensor<2>, bias: Tensor<2>, epsilon: f64) -> Tensor<2> {
    Tensor::cat(vec![gain / (variance + epsilon).sqrt(), mean, bias], 0)
}

/// Mean and variance of `x[channels, pixels]` as `[2, channels]`.
#[derive(Clone, Copy, Debug)]
struct MomentsKernel;

impl Kernel for MomentsKernel {
    fn output_size(&self, sizes: &[[usize; 2]]) -> [usize; 2] {
        [2, sizes[0][0]]
    }

    fn forward<T: Number>(&self, inputs: &[&[T]], sizes: &[[usize; 2]]) -> Vec<T> {
        let pixels = sizes[0][1];
        let both: Vec<[f64; 2]> =
            inputs[0].par_chunks(pixels).map(|row| Arch::new().dispatch(RowMoments(row))).collect();
        (0..2).flat_map(|i| both.iter().map(move |both| T::from_f64(both[i]))).collect()
    }

    fn backward<T: Number>(&self, inputs: &[&[T]], sizes: &[[usize; 2]], gradient: &[T], _: &[bool]) -> Vec<Vec<T>> {
        let pixels = sizes[0][1];
        let (by_mean, by_variance) = gradient.split_at(sizes[0][0]);
        let mut out = zeros(inputs[0].len());
        let rows = out.par_chunks_mut(pixels).zip(inputs[0].par_chunks(pixels));
        rows.zip(by_mean.par_iter().zip(by_variance)).for_each(|((out, x), (by_mean, by_variance))| {
            let count = pixels as f64;
            let mean = total(x) / count;
            let slope = 2.0 * by_variance.as_f64() / count;
            let (slope, constant) = (T::from_f64(slope), T::from_f64(by_mean.as_f64() / count - slope * mean));
            out.iter_mut().zip(x).for_each(|(out, &x)| *out = slope * x + constant);
        });
        vec![out]
    }
}

struct RowMoments<'a, T>(&'a [T]);

impl<T: Number> WithSimd for RowMoments<'_, T> {
    type Output = [f64; 2];

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) -> [f64; 2] {
        let count = self.0.len() as f64;
        let mean = total(self.0) / count;
        let narrow = T::from_f64(mean);
        let (chunks, rest) = self.0.as_chunks::<LANES>();
        let mut squares = [T::default(); LANES];
        for chunk in chunks {
            squares.iter_mut().zip(chunk).for_each(|(sum, &x)| *sum += (x - narrow) * (x - narrow));
        }
        squares.iter_mut().zip(rest).for_each(|(sum, &x)| *sum += (x - narrow) * (x - narrow));
        [mean, squares.iter().map(|sum| sum.as_f64()).sum::<f64>() / count]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{assert_gradients, assert_same_function};

    #[test]
    fn kernel_equals_reference() {
        for pixels in [1, 40, 100] {
            assert_same_function(&[[6, pixels]], |[x]| unary(x, MomentsKernel), |[x]| composed(x));
        }
    }

    #[test]
    fn gradients_equal_finite_differences() {
        assert_gradients(&[[6, 35]], |[x]| unary(x, MomentsKernel));
    }

    #[test]
    fn variance_is_accurate_at_large_means() {
        let x: Vec<f32> = (0..3000).map(|i| 3000.0 + (i as f32 * 0.7).sin()).collect();
        let variance = MomentsKernel.forward(&[&x], &[[1, 3000]])[1];
        assert!((variance - 0.5).abs() < 1e-3, "{variance}");
    }
}
