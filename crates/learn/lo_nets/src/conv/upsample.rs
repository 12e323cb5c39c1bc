use burn::tensor::Tensor;
use rayon::prelude::*;

use crate::cpu_ops::{Kernel, Number, binary, unary, zeros};

/// Doubles the resolution by nearest neighbours, and appends the channels of an optional
/// `skip[more, images, 2 · height, 2 · width]`. The convolution that follows can learn to smooth.
///
/// # Panics
/// Where `skip` has another size.
pub fn upsample_nearest(x: Tensor<4>, skip: Option<Tensor<4>>) -> Tensor<4> {
    let [channels, images, height, width] = x.dims();
    let kernel = UpsampleKernel { width };
    let x = x.reshape([channels * images, height * width]);
    let (y, more) = match skip {
        Some(skip) => {
            let [more, skip_images, skip_height, skip_width] = skip.dims();
            assert_eq!([skip_images, skip_height, skip_width], [images, 2 * height, 2 * width], "twice the size");
            (binary(x, skip.reshape([more * images, 4 * height * width]), kernel), more)
        }
        None => (unary(x, kernel), 0),
    };
    y.reshape([channels + more, images, 2 * height, 2 * width])
}

/// Reference implementation with burn's operations.
#[cfg(test)]
fn composed(x: Tensor<4>, skip: Option<Tensor<4>>) -> Tensor<4> {
    let [channels, images, height, width] = x.dims();
    let x: Tensor<6> = x.reshape([channels, images, height, 1, width, 1]);
    let x = x.expand([channels, images, height, 2, width, 2]).reshape([channels, images, 2 * height, 2 * width]);
    match skip {
        Some(skip) => Tensor::cat(vec![x, skip], 0),
        None => x,
    }
}

/// [`upsample_nearest`] on slices.
#[derive(Clone, Copy, Debug)]
struct UpsampleKernel {
    width: usize,
}

impl Kernel for UpsampleKernel {
    fn output_size(&self, sizes: &[[usize; 2]]) -> [usize; 2] {
        let more = sizes.get(1).map_or(0, |skip| skip[0]);
        [sizes[0][0] + more, 4 * sizes[0][1]]
    }

    fn forward<T: Number>(&self, inputs: &[&[T]], sizes: &[[usize; 2]]) -> Vec<T> {
        let [channels, area] = self.output_size(sizes);
        let mut out = zeros(channels * area);
        let (upsampled, rest) = out.split_at_mut(4 * inputs[0].len());
        upsampled.par_chunks_mut(4 * self.width).zip(inputs[0].par_chunks(self.width)).for_each(|(rows, x)| {
            let (upper, lower) = rows.split_at_mut(2 * self.width);
            upper.as_chunks_mut::<2>().0.iter_mut().zip(x).for_each(|(pair, &x)| *pair = [x; 2]);
            lower.copy_from_slice(upper);
        });
        if let Some(skip) = inputs.get(1) {
            rest.par_chunks_mut(area).zip(skip.par_chunks(area)).for_each(|(out, skip)| out.copy_from_slice(skip));
        }
        out
    }

    fn backward<T: Number>(&self, inputs: &[&[T]], _: &[[usize; 2]], gradient: &[T], wanted: &[bool]) -> Vec<Vec<T>> {
        let (upsampled, rest) = gradient.split_at(4 * inputs[0].len());
        let mut by_x = zeros(inputs[0].len());
        by_x.par_chunks_mut(self.width).zip(upsampled.par_chunks(4 * self.width)).for_each(|(out, rows)| {
            let (upper, lower) = rows.split_at(2 * self.width);
            let pairs = upper.as_chunks::<2>().0.iter().zip(lower.as_chunks::<2>().0);
            out.iter_mut()
                .zip(pairs)
                .for_each(|(out, (upper, lower))| *out = upper[0] + upper[1] + (lower[0] + lower[1]));
        });
        let mut derivatives = vec![by_x];
        if let [_, true] = wanted {
            derivatives.push(rest.to_vec());
        }
        derivatives
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{assert_gradients, assert_same_function};

    /// Three and two channels of two images.
    const SIZES: [[usize; 2]; 2] = [[3, 2 * 4 * 5], [2, 2 * 8 * 10]];

    fn on_images(x: Tensor<2>, skip: Option<Tensor<2>>, composed_of_burn: bool) -> Tensor<2> {
        let x = x.reshape([3, 2, 4, 5]);
        let skip = skip.map(|skip| skip.reshape([2, 2, 8, 10]));
        let y = if composed_of_burn { composed(x, skip) } else { upsample_nearest(x, skip) };
        y.flatten(0, 2)
    }

    #[test]
    fn kernel_equals_reference() {
        assert_same_function(&SIZES, |[x, s]| on_images(x, Some(s), false), |[x, s]| on_images(x, Some(s), true));
        assert_same_function(
            &SIZES[..1].try_into().expect("one"),
            |[x]| on_images(x, None, false),
            |[x]| on_images(x, None, true),
        );
    }

    #[test]
    fn gradients_equal_finite_differences() {
        assert_gradients(&SIZES, |[x, s]| on_images(x, Some(s), false));
    }
}
