use burn::tensor::Tensor;
use pulp::{Arch, Simd, WithSimd};
use rayon::prelude::*;

use crate::cpu_ops::{Kernel, Number, unary, zeros};

/// Max pooling over 3 × 3 pixels with stride 2: `[channels, images, ⌈height / 2⌉, ⌈width / 2⌉]`.
pub fn max_pool(x: Tensor<4>) -> Tensor<4> {
    let [channels, images, height, width] = x.dims();
    let y = unary(x.reshape([channels * images, height * width]), MaxPoolKernel { size: [height, width] });
    y.reshape([channels, images, height.div_ceil(2), width.div_ceil(2)])
}

/// Reference implementation with burn's operation, which is slow (a tenth of DenseNet's time).
#[cfg(test)]
fn composed(x: Tensor<4>) -> Tensor<4> {
    use burn::tensor::module::max_pool2d;
    use burn::tensor::ops::MaxPoolOptions;

    max_pool2d(x, MaxPoolOptions::new([3, 3]).with_stride([2, 2]).with_padding([1, 1]))
}

/// [`max_pool`] on slices.
#[derive(Clone, Copy, Debug)]
struct MaxPoolKernel {
    /// Height and width.
    size: [usize; 2],
}

impl Kernel for MaxPoolKernel {
    fn output_size(&self, sizes: &[[usize; 2]]) -> [usize; 2] {
        let [height, width] = self.size;
        assert_eq!(sizes[0][1], height * width, "the image has the kernel's size");
        [sizes[0][0], height.div_ceil(2) * width.div_ceil(2)]
    }

    fn forward<T: Number>(&self, inputs: &[&[T]], sizes: &[[usize; 2]]) -> Vec<T> {
        let [channels, area] = self.output_size(sizes);
        let [height, width] = self.size;
        let mut out = zeros(channels * area);
        out.par_chunks_mut(area).zip(inputs[0].par_chunks(height * width)).for_each(|(out, x)| {
            Arch::new().dispatch(Pool { out, x, width });
        });
        out
    }

    fn backward<T: Number>(&self, inputs: &[&[T]], _: &[[usize; 2]], gradient: &[T], _: &[bool]) -> Vec<Vec<T>> {
        let [height, width] = self.size;
        let half_width = width.div_ceil(2);
        let mut by_x = zeros(inputs[0].len());
        by_x.par_chunks_mut(height * width)
            .zip(inputs[0].par_chunks(height * width))
            .zip(gradient.par_chunks(height.div_ceil(2) * half_width))
            .for_each(|((by_x, x), gradient)| {
                for (i, &gradient) in gradient.iter().enumerate() {
                    let [row, column] = [2 * (i / half_width), 2 * (i % half_width)];
                    // The first of equal values, as in PyTorch.
                    let mut largest = None;
                    for y in row.saturating_sub(1)..height.min(row + 2) {
                        for place in y * width + column.saturating_sub(1)..y * width + width.min(column + 2) {
                            if largest.is_none_or(|largest| larger(x[place], x[largest])) {
                                largest = Some(place);
                            }
                        }
                    }
                    by_x[largest.expect("a window has a middle pixel")] += gradient;
                }
            });
        vec![by_x]
    }
}

/// Compares with NaN as the largest value, so that it is noticed.
#[inline(always)]
fn larger<T: Number>(a: T, b: T) -> bool {
    #[allow(clippy::eq_op)] // only NaN differs from itself
    let nan = a != a && b == b;
    a > b || nan
}

/// Pools one channel.
struct Pool<'a, T> {
    out: &'a mut [T],
    x: &'a [T],
    width: usize,
}

impl<T: Number> WithSimd for Pool<'_, T> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        let Self { out, x, width } = self;
        let height = x.len() / width;
        let most = |a: T, b: T| if larger(a, b) { a } else { b };
        let mut column_most = vec![T::default(); width];
        for (i, out) in out.chunks_exact_mut(width.div_ceil(2)).enumerate() {
            let row = |y: usize| &x[y * width..][..width];
            column_most.copy_from_slice(row(2 * i));
            for y in [(2 * i).wrapping_sub(1), 2 * i + 1].into_iter().filter(|&y| y < height) {
                column_most.iter_mut().zip(row(y)).for_each(|(most_yet, &x)| *most_yet = most(x, *most_yet));
            }
            // Column pairs; the column before a pair is the second one of the previous pair.
            let mut before = column_most[0];
            for (out, pair) in out.iter_mut().zip(column_most.chunks(2)) {
                let after = pair[pair.len() - 1];
                *out = most(most(before, pair[0]), after);
                before = after;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{assert_gradients, assert_same_function};

    const SIZES: [[usize; 2]; 4] = [[8, 10], [7, 9], [1, 5], [6, 1]];

    #[test]
    fn kernel_equals_reference() {
        for [height, width] in SIZES {
            let on_image = |x: Tensor<2>, function: fn(Tensor<4>) -> Tensor<4>| {
                function(x.reshape([3, 2, height, width])).flatten::<2>(0, 2)
            };
            assert_same_function(&[[3, 2 * height * width]], |[x]| on_image(x, max_pool), |[x]| on_image(x, composed));
        }
    }

    #[test]
    fn gradients_equal_finite_differences() {
        for size in SIZES {
            assert_gradients(&[[2, size[0] * size[1]]], |[x]| unary(x, MaxPoolKernel { size }));
        }
    }

    #[test]
    fn nan_is_propagated() {
        let mut x = [0.0f32; 16];
        x[5] = f32::NAN;
        let y = MaxPoolKernel { size: [4, 4] }.forward(&[&x], &[[1, 16]]);
        assert!(y.iter().all(|y| y.is_nan()), "{y:?}");
    }
}
