use std::sync::Arc;

use burn::tensor::Tensor;
use lo_dual::{Matrix, matmul};
use rayon::prelude::*;

use crate::cpu_ops::{Kernel, Number, binary};
use crate::graph::{GraphLevel, Refinement};

/// Families of eight siblings for each task. Their parts of the weights' gradient are summed in a fixed order.
const BLOCK: usize = 1 << 8;

/// Pools to the graph one depth coarser than `finer`. `[finer nodes, channels] → [coarser nodes, channels]`.
///
/// The concatenated features of eight siblings, times `weights[8 · channels, channels]`, become their parent's. Leaves
/// pass unchanged.
///
/// # Panics
/// Where `finer` is of the full depth, or sizes do not match.
pub fn down_sample(x: Tensor<2>, weights: Tensor<2>, finer: &Arc<GraphLevel>) -> Tensor<2> {
    binary(x, weights, DownKernel(finer.clone()))
}

/// Unpools to `finer` from the graph one depth coarser. `[coarser nodes, channels] → [finer nodes, channels]`.
///
/// The features of a split node, times `weights[channels, 8 · channels]`, become its eight children's. Leaves pass
/// unchanged.
///
/// # Panics
/// Where `finer` is of the full depth, or sizes do not match.
pub fn up_sample(x: Tensor<2>, weights: Tensor<2>, finer: &Arc<GraphLevel>) -> Tensor<2> {
    binary(x, weights, UpKernel(finer.clone()))
}

fn refinement(finer: &GraphLevel) -> &Refinement {
    finer.refinement.as_ref().expect("levels below the full depth have a coarser one")
}

/// Reference implementation with burn's operations.
#[cfg(test)]
fn composed_down(x: Tensor<2>, weights: Tensor<2>, finer: &GraphLevel) -> Tensor<2> {
    use burn::tensor::{Int, TensorData};
    let Refinement { kept, split } = refinement(finer);
    let ([rows, channels], device) = (x.dims(), x.device());
    let merged =
        x.clone().narrow(0, kept.len(), rows - kept.len()).reshape([split.len(), 8 * channels]).matmul(weights);
    // Source rows of the coarser graph: kept rows first, then the merged ones.
    let mut sources = vec![0i64; kept.len() + split.len()];
    kept.iter().chain(split).enumerate().for_each(|(source, &node)| sources[node as usize] = source as i64);
    let sources = Tensor::<1, Int>::from_data(TensorData::new(sources, [kept.len() + split.len()]), &device);
    Tensor::cat(vec![x.narrow(0, 0, kept.len()), merged], 0).select(0, sources)
}

/// Reference implementation with burn's operations.
#[cfg(test)]
fn composed_up(x: Tensor<2>, weights: Tensor<2>, finer: &GraphLevel) -> Tensor<2> {
    use burn::tensor::{Int, TensorData};
    let Refinement { kept, split } = refinement(finer);
    let ([_, channels], device) = (x.dims(), x.device());
    let rows = |nodes: &[u32]| {
        let nodes: Vec<i64> = nodes.iter().map(|&node| i64::from(node)).collect();
        let count = nodes.len();
        x.clone().select(0, Tensor::<1, Int>::from_data(TensorData::new(nodes, [count]), &device))
    };
    let children = rows(split).matmul(weights).reshape([8 * split.len(), channels]);
    Tensor::cat(vec![rows(kept), children], 0)
}

#[derive(Clone, Debug)]
struct DownKernel(Arc<GraphLevel>);

#[derive(Clone, Debug)]
struct UpKernel(Arc<GraphLevel>);

impl Kernel for DownKernel {
    fn output_size(&self, sizes: &[[usize; 2]]) -> [usize; 2] {
        let Refinement { kept, split } = refinement(&self.0);
        let channels = sizes[0][1];
        assert_eq!(sizes[0][0], self.0.len(), "one row of features for each node");
        assert_eq!(sizes[1], [8 * channels, channels], "the weights of eight siblings");
        [kept.len() + split.len(), channels]
    }

    fn forward<T: Number>(&self, inputs: &[&[T]], sizes: &[[usize; 2]]) -> Vec<T> {
        let [rows, channels] = self.output_size(sizes);
        let Refinement { kept, split } = refinement(&self.0);
        let (leaves, families) = inputs[0].split_at(kept.len() * channels);
        let mut merged = vec![T::default(); split.len() * channels];
        multiply(&mut merged, families, inputs[1], [8 * channels, channels]);
        let mut output = vec![T::default(); rows * channels];
        scatter_rows(&mut output, leaves, kept, channels);
        scatter_rows(&mut output, &merged, split, channels);
        output
    }

    fn backward<T: Number>(&self, inputs: &[&[T]], sizes: &[[usize; 2]], gradient: &[T], _: &[bool]) -> Vec<Vec<T>> {
        let [_, channels] = self.output_size(sizes);
        let Refinement { kept, split } = refinement(&self.0);
        let merged = gather_rows(gradient, split, channels);
        let mut by_input = gather_rows(gradient, kept, channels);
        by_input.resize(inputs[0].len(), T::default());
        let families = kept.len() * channels;
        multiply_transposed(&mut by_input[families..], &merged, inputs[1], [8 * channels, channels]);
        let by_weights = weight_gradient(&inputs[0][families..], &merged, [8 * channels, channels]);
        vec![by_input, by_weights]
    }
}

impl Kernel for UpKernel {
    fn output_size(&self, sizes: &[[usize; 2]]) -> [usize; 2] {
        let Refinement { kept, split } = refinement(&self.0);
        let channels = sizes[0][1];
        assert_eq!(sizes[0][0], kept.len() + split.len(), "one row of features for each node");
        assert_eq!(sizes[1], [channels, 8 * channels], "the weights of eight children");
        [self.0.len(), channels]
    }

    fn forward<T: Number>(&self, inputs: &[&[T]], sizes: &[[usize; 2]]) -> Vec<T> {
        let [rows, channels] = self.output_size(sizes);
        let Refinement { kept, split } = refinement(&self.0);
        let parents = gather_rows(inputs[0], split, channels);
        let mut output = gather_rows(inputs[0], kept, channels);
        output.resize(rows * channels, T::default());
        multiply(&mut output[kept.len() * channels..], &parents, inputs[1], [channels, 8 * channels]);
        output
    }

    fn backward<T: Number>(&self, inputs: &[&[T]], sizes: &[[usize; 2]], gradient: &[T], _: &[bool]) -> Vec<Vec<T>> {
        let channels = sizes[0][1];
        let Refinement { kept, split } = refinement(&self.0);
        let (leaves, families) = gradient.split_at(kept.len() * channels);
        let mut by_parents = vec![T::default(); split.len() * channels];
        multiply_transposed(&mut by_parents, families, inputs[1], [channels, 8 * channels]);
        let mut by_input = vec![T::default(); inputs[0].len()];
        scatter_rows(&mut by_input, leaves, kept, channels);
        scatter_rows(&mut by_input, &by_parents, split, channels);
        let parents = gather_rows(inputs[0], split, channels);
        vec![by_input, weight_gradient(&parents, families, [channels, 8 * channels])]
    }
}

/// Computes `out[rows, n] = x[rows, k] · weights[k, n]`.
fn multiply<T: Number>(out: &mut [T], x: &[T], weights: &[T], [k, n]: [usize; 2]) {
    out.par_chunks_mut(BLOCK * n).zip(x.par_chunks(BLOCK * k)).for_each(|(out, x)| {
        matmul(out, Matrix::new(x, k), Matrix::new(weights, n), false);
    });
}

/// Computes `out[rows, k] = y[rows, n] · weights[k, n]ᵀ`.
fn multiply_transposed<T: Number>(out: &mut [T], y: &[T], weights: &[T], [k, n]: [usize; 2]) {
    out.par_chunks_mut(BLOCK * k).zip(y.par_chunks(BLOCK * n)).for_each(|(out, y)| {
        matmul(out, Matrix::new(y, n), Matrix::new(weights, n).transposed(), false);
    });
}

/// Returns `x[rows, k]ᵀ · y[rows, n]`, summed in parts of fixed size.
fn weight_gradient<T: Number>(x: &[T], y: &[T], [k, n]: [usize; 2]) -> Vec<T> {
    // At most 16 parts, so that they stay small compared with the features.
    let rows = (x.len() / k).div_ceil(16).next_multiple_of(BLOCK);
    let parts: Vec<Vec<T>> = x
        .par_chunks(rows * k)
        .zip(y.par_chunks(rows * n))
        .map(|(x, y)| {
            let mut part = vec![T::default(); k * n];
            matmul(&mut part, Matrix::new(x, k).transposed(), Matrix::new(y, n), false);
            part
        })
        .collect();
    let mut sum = vec![T::default(); k * n];
    for part in parts {
        sum.iter_mut().zip(part).for_each(|(sum, value)| *sum += value);
    }
    sum
}

fn gather_rows<T: Number>(x: &[T], nodes: &[u32], channels: usize) -> Vec<T> {
    let mut rows = Vec::with_capacity(nodes.len() * channels);
    nodes.iter().for_each(|&node| rows.extend_from_slice(&x[node as usize * channels..][..channels]));
    rows
}

fn scatter_rows<T: Number>(out: &mut [T], rows: &[T], nodes: &[u32], channels: usize) {
    for (row, &node) in rows.chunks_exact(channels).zip(nodes) {
        out[node as usize * channels..][..channels].copy_from_slice(row);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::graph::level::tests::uneven_octree;
    use crate::testing::{assert_gradients, assert_same_function};

    #[test]
    fn kernels_equal_references() {
        for levels in GraphLevel::all(&uneven_octree()).windows(2) {
            let (coarser, finer) = (levels[0].len(), &levels[1]);
            let sizes = [[finer.len(), 3], [24, 3]];
            assert_same_function(&sizes, |[x, w]| down_sample(x, w, finer), |[x, w]| composed_down(x, w, finer));
            let sizes = [[coarser, 3], [3, 24]];
            assert_same_function(&sizes, |[x, w]| up_sample(x, w, finer), |[x, w]| composed_up(x, w, finer));
        }
    }

    #[test]
    fn gradients_equal_finite_differences() {
        let levels = GraphLevel::all(&uneven_octree());
        let finer = &levels[2];
        assert_gradients(&[[finer.len(), 2], [16, 2]], |[x, w]| down_sample(x, w, finer));
        assert_gradients(&[[levels[1].len(), 2], [2, 16]], |[x, w]| up_sample(x, w, finer));
    }
}
