use burn::tensor::Tensor;
use lo_dual::{Matrix, matmul};
use rayon::prelude::*;

use crate::cpu_ops::{Kernel, Number, binary, ternary};

/// Rows for each task. Their parts of the weights' gradient are summed in a fixed order.
const BLOCK: usize = 1 << 10;

/// Returns `x[nodes, in] · weights[in, out]`, plus an optional `bias[1, out]`, as `[nodes, out]`.
pub fn linear(x: Tensor<2>, weights: Tensor<2>, bias: Option<Tensor<2>>) -> Tensor<2> {
    match bias {
        Some(bias) => ternary(x, weights, bias, LinearKernel),
        None => binary(x, weights, LinearKernel),
    }
}

/// Reference implementation with burn's operations.
#[cfg(test)]
fn composed(x: Tensor<2>, weights: Tensor<2>, bias: Option<Tensor<2>>) -> Tensor<2> {
    let product = x.matmul(weights);
    match bias {
        Some(bias) => product + bias,
        None => product,
    }
}

/// [`linear`] on slices. burn's product is slow in the gradients of tall matrices: 28–55 GFLOP per core and second,
/// against 80 forward.
#[derive(Clone, Debug)]
struct LinearKernel;

impl Kernel for LinearKernel {
    fn output_size(&self, sizes: &[[usize; 2]]) -> [usize; 2] {
        assert_eq!(sizes[0][1], sizes[1][0], "one row of weights for each channel");
        [sizes[0][0], sizes[1][1]]
    }

    fn forward<T: Number>(&self, inputs: &[&[T]], sizes: &[[usize; 2]]) -> Vec<T> {
        let [rows, outputs] = self.output_size(sizes);
        let channels = sizes[0][1];
        let mut output = vec![T::default(); rows * outputs];
        output.par_chunks_mut(BLOCK * outputs).zip(inputs[0].par_chunks(BLOCK * channels)).for_each(|(output, x)| {
            if let [_, _, bias] = inputs {
                output.chunks_exact_mut(outputs).for_each(|row| row.copy_from_slice(bias));
            }
            matmul(output, Matrix::new(x, channels), Matrix::new(inputs[1], outputs), inputs.len() == 3);
        });
        output
    }

    fn backward<T: Number>(
        &self,
        inputs: &[&[T]],
        sizes: &[[usize; 2]],
        gradient: &[T],
        wanted: &[bool],
    ) -> Vec<Vec<T>> {
        let ([rows, outputs], channels) = (self.output_size(sizes), sizes[0][1]);
        let weights = Matrix::new(inputs[1], outputs);
        let mut by_input = vec![T::default(); if wanted[0] { rows * channels } else { 0 }];
        by_input.par_chunks_mut(BLOCK * channels).zip(gradient.par_chunks(BLOCK * outputs)).for_each(
            |(by_input, gradient)| {
                matmul(by_input, Matrix::new(gradient, outputs), weights.transposed(), false);
            },
        );
        let parts: Vec<Vec<T>> = inputs[0]
            .par_chunks(BLOCK * channels)
            .zip(gradient.par_chunks(BLOCK * outputs))
            .map(|(x, gradient)| {
                // The gradient of the weights, followed by that of the bias.
                let mut part = vec![T::default(); (channels + 1) * outputs];
                let (by_weights, by_bias) = part.split_at_mut(channels * outputs);
                matmul(by_weights, Matrix::new(x, channels).transposed(), Matrix::new(gradient, outputs), false);
                for row in gradient.chunks_exact(outputs) {
                    by_bias.iter_mut().zip(row).for_each(|(sum, &g)| *sum += g);
                }
                part
            })
            .collect();
        let mut by_weights = vec![T::default(); (channels + 1) * outputs];
        for part in parts {
            by_weights.iter_mut().zip(part).for_each(|(sum, value)| *sum += value);
        }
        let by_bias = by_weights.split_off(channels * outputs);
        vec![by_input, by_weights, by_bias]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{assert_gradients, assert_same_function};

    #[test]
    fn kernel_equals_reference() {
        let sizes = [[1500, 5], [5, 3], [1, 3]];
        assert_same_function(&sizes, |[x, w, b]| linear(x, w, Some(b)), |[x, w, b]| composed(x, w, Some(b)));
        assert_same_function(&[[70, 5], [5, 3]], |[x, w]| linear(x, w, None), |[x, w]| composed(x, w, None));
    }

    #[test]
    fn gradients_equal_finite_differences() {
        assert_gradients(&[[90, 4], [4, 3], [1, 3]], |[x, w, b]| linear(x, w, Some(b)));
    }
}
