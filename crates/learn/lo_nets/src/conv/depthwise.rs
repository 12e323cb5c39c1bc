//! Depthwise convolution: every channel by weights of its own.

use rayon::prelude::*;

use crate::conv::activation::{Affine, Rectifier, through_activation};
use crate::conv::window::Window;
use crate::host::{Kernel, Number, zeros};
use crate::sums::LANES;

/// Columns of a band, so that it and its output stay in the first cache.
const BAND_COLUMNS: usize = 4096;

/// A convolution of `x[channels, pictures · height · width]`, each channel with its row of `weights[channels, kernel²]`. Gives
/// `[channels, pictures · height · width]` of the output.
#[derive(Clone, Copy, Debug)]
pub struct DepthwiseKernel {
    /// What is read.
    pub window: Window,
    /// With it there is a third input, `[3, channels]`, scale, centre and shift: what is convolved is scale · (x − centre) + shift
    /// rectified, which is never stored.
    pub rectifier: Option<Rectifier>,
}

impl DepthwiseKernel {
    fn activation<'a, T: Number>(&self, inputs: &[&'a [T]]) -> Option<Affine<'a, T>> {
        self.rectifier.map(|rectifier| Affine::new(inputs[2], rectifier))
    }
}

impl Kernel for DepthwiseKernel {
    fn output_size(&self, sizes: &[[usize; 2]]) -> [usize; 2] {
        let [channels, area] = sizes[0];
        assert_eq!(area, self.window.input_area(), "the pictures have the window's size");
        assert_eq!(sizes[1], [channels, self.window.kernel.pow(2)], "weights for each channel");
        let affine = self.rectifier.map(|_| [3, channels]);
        assert_eq!(sizes.get(2), affine.as_ref(), "a scale, a centre and a shift for each channel, or none");
        [channels, self.window.pictures * self.window.area()]
    }

    fn forward<T: Number>(&self, inputs: &[&[T]], sizes: &[[usize; 2]]) -> Vec<T> {
        self.output_size(sizes);
        convolve(&self.window, inputs[0], self.activation(inputs), inputs[1])
    }

    fn backward<T: Number>(&self, inputs: &[&[T]], _: &[[usize; 2]], gradient: &[T], wanted: &[bool]) -> Vec<Vec<T>> {
        let activation = self.activation(inputs);
        let mut derivatives = vec![Vec::new(); inputs.len()];
        if wanted[0] || (activation.is_some() && wanted[2]) {
            // By what was convolved: a convolution with the weights turned round.
            let taps = self.window.kernel.pow(2);
            let turned: Vec<T> = inputs[1].chunks_exact(taps).flat_map(|row| row.iter().rev().copied()).collect();
            derivatives[0] = convolve(&self.window.transposed(), gradient, None, &turned);
            if let Some(activation) = activation {
                derivatives[2] = through_activation(&mut derivatives[0], inputs[0], activation, true);
            }
        }
        if wanted[1] {
            derivatives[1] = weight_gradient(&self.window, inputs[0], activation, gradient);
        }
        derivatives
    }
}

/// Output rows of a band.
fn band_rows(window: &Window) -> usize {
    let all = window.rows().max(1);
    let rows = (BAND_COLUMNS / window.plane(1).max(1)).clamp(1, all);
    all.div_ceil(all.div_ceil(rows))
}

fn convolve<T: Number>(window: &Window, x: &[T], activation: Option<Affine<T>>, weights: &[T]) -> Vec<T> {
    let (rows, taps) = (band_rows(window), window.kernel.pow(2));
    let offsets = window.offsets(1, rows);
    let (height, width, pitch) = (window.rows(), window.output[1], window.pitch());
    let area = window.pictures * window.area();
    let mut out = zeros(x.len() / window.input_area() * area);
    let channels = out.par_chunks_mut(area).zip(x.par_chunks(window.input_area())).zip(weights.par_chunks(taps));
    let scratch = || (Vec::new(), vec![T::default(); (rows * pitch).next_multiple_of(LANES)]);
    channels.enumerate().for_each_init(scratch, |(band, sums), (channel, ((out, x), weights))| {
        let activation = activation.map(|affine| affine.part(channel..channel + 1));
        let mut out = out.chunks_exact_mut(width);
        for first in (0..height).step_by(rows) {
            window.read(band, [first, rows], x, activation);
            T::filter(weights, band, &offsets, sums);
            let sums = (first..height).zip(sums.chunks_exact(pitch).take(rows));
            for ((_, sums), out) in sums.filter(|(row, _)| window.is_row(*row)).zip(&mut out) {
                out.copy_from_slice(&sums[..width]);
            }
        }
    });
    out
}

/// Gradient by the weights, `[channels, kernel²]`.
fn weight_gradient<T: Number>(window: &Window, x: &[T], activation: Option<Affine<T>>, gradient: &[T]) -> Vec<T> {
    let (rows, taps) = (band_rows(window), window.kernel.pow(2));
    let offsets = window.offsets(1, rows);
    let (height, width, pitch) = (window.rows(), window.output[1], window.pitch());
    let area = window.pictures * window.area();
    let mut out = zeros(x.len() / window.input_area() * taps);
    let channels = out.par_chunks_mut(taps).zip(x.par_chunks(window.input_area())).zip(gradient.par_chunks(area));
    let scratch = || (Vec::new(), vec![T::default(); rows * pitch]);
    channels.enumerate().for_each_init(scratch, |(band, padded), (channel, ((out, x), gradient))| {
        let activation = activation.map(|affine| affine.part(channel..channel + 1));
        let mut gradient = gradient.chunks_exact(width);
        for first in (0..height).step_by(rows) {
            window.read(band, [first, rows], x, activation);
            // Rows as wide as those of the band, with zeros where they mean nothing.
            for (row, out) in (first..).zip(padded.chunks_exact_mut(pitch)) {
                let gradient = if row < height && window.is_row(row) { gradient.next() } else { None };
                let (left, right) = out.split_at_mut(gradient.map_or(0, <[T]>::len));
                left.copy_from_slice(gradient.unwrap_or_default());
                right.fill(T::default());
            }
            T::inner(&[padded], band, &offsets, out);
        }
    });
    out
}

/// The same by burn's own operations, to check the kernel.
#[cfg(test)]
mod tests {
    use burn::tensor::Tensor;
    use burn::tensor::module;
    use burn::tensor::ops::{ConvOptions, PadMode};

    use super::*;
    use crate::conv::activation;
    use crate::host::{binary, ternary};
    use crate::testing::{assert_gradients, assert_same_function};

    /// Channels; pictures, height and width; kernel, stride, padding before and after.
    type Case = (usize, [usize; 3], [usize; 4]);

    const CASES: [Case; 9] = [
        (5, [1, 6, 7], [3, 1, 1, 1]),
        (3, [2, 9, 4], [5, 1, 2, 2]),
        (4, [1, 8, 10], [3, 2, 0, 1]),
        (4, [2, 8, 6], [5, 2, 1, 2]),
        (2, [3, 7, 9], [3, 2, 1, 1]),
        (2, [1, 5, 4], [1, 1, 0, 0]),
        (2, [2, 7, 8], [3, 3, 1, 1]),
        (3, [1, 1, 1], [5, 2, 2, 2]),
        (2, [2, 130, 150], [5, 1, 2, 2]),
    ];

    fn kernel((_, [pictures, height, width], [side, stride, before, after]): Case, activated: bool) -> DepthwiseKernel {
        let window = Window { pictures, ..Window::new([height, width], side, stride, [before, after]) };
        DepthwiseKernel { window, rectifier: activated.then_some(Rectifier::Relu6) }
    }

    fn sizes((channels, [pictures, height, width], [side, ..]): Case) -> [[usize; 2]; 3] {
        [[channels, pictures * height * width], [channels, side * side], [3, channels]]
    }

    fn run(case: Case, [x, weights]: [Tensor<2>; 2], affine: Option<Tensor<2>>) -> Tensor<2> {
        // So that some of what is activated reaches 6.
        match affine {
            Some(affine) => ternary(x, weights, 4.0 * affine, kernel(case, true)),
            None => binary(x, weights, kernel(case, false)),
        }
    }

    /// By burn's own operations.
    fn composed(case: Case, [x, weights]: [Tensor<2>; 2], affine: Option<Tensor<2>>) -> Tensor<2> {
        let (channels, [pictures, height, width], [side, stride, before, after]) = case;
        let mut x = x.reshape([channels, pictures, height, width]);
        if let Some(affine) = affine {
            x = activation::composed(x, 4.0 * affine, activation::Then::Rectified(Rectifier::Relu6));
        }
        let x = x.swap_dims(0, 1).pad((before, after, before, after), PadMode::Constant(0.0));
        let options = ConvOptions::new([stride; 2], [0; 2], [1; 2], channels);
        let y = module::conv2d(x, weights.reshape([channels, 1, side, side]), None, options);
        y.swap_dims(0, 1).reshape([channels as i32, -1])
    }

    #[test]
    fn kernel_is_the_composition() {
        for case in CASES {
            let [x, weights, affine] = sizes(case);
            assert_same_function(&[x, weights], |i| run(case, i, None), |i| composed(case, i, None));
            assert_same_function(
                &[x, weights, affine],
                |[x, w, a]| run(case, [x, w], Some(a)),
                |[x, w, a]| composed(case, [x, w], Some(a)),
            );
        }
    }

    #[test]
    fn gradients_are_differences() {
        for case in &CASES[..8] {
            let [x, weights, affine] = sizes(*case);
            assert_gradients(&[x, weights], |i| run(*case, i, None));
            assert_gradients(&[x, weights, affine], |[x, w, a]| run(*case, [x, w], Some(a)));
        }
    }

    #[test]
    fn threads_do_not_change_a_bit() {
        let case = CASES[8];
        let sizes = sizes(case);
        let values = |i: usize| -> Vec<f32> {
            crate::testing::values(sizes[i][0] * sizes[i][1], i).iter().map(|&v| v as f32).collect()
        };
        let inputs = [values(0), values(1), values(2)];
        let inputs: Vec<&[f32]> = inputs.iter().map(Vec::as_slice).collect();
        let kernel = kernel(case, true);
        let on = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
            pool.install(|| {
                let output = kernel.forward(&inputs, &sizes);
                (kernel.backward(&inputs, &sizes, &output, &[true; 3]), output)
            })
        };
        assert!(on(1) == on(3));
    }
}
