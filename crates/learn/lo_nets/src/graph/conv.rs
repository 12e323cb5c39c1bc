use std::sync::Arc;

use burn::tensor::Tensor;
use lo_dual::{EDGE_TYPES, graph_conv_backward, graph_conv_onto};
use rayon::prelude::*;

use crate::cpu_ops::{Kernel, Number, binary};
use crate::graph::GraphLevel;

/// Rows of one partial sum over nodes. Fixed, so that results do not depend on the number of threads.
const PART_ROWS: usize = 1 << 12;

/// Graph convolution (Wang et al. 2022) in `ognn`'s layout. Returns `[nodes, out]`.
///
/// Averages features `x[nodes, in]` and the one-hot depth of each node over the neighbours of each of seven edge types,
/// and multiplies by `weights[7 · (in + depths), out]`. Depths count from the full depth to the graph's. A graph of the
/// full depth has a single depth and no one-hot.
///
/// # Panics
/// Where the sizes do not match.
pub fn graph_conv(x: Tensor<2>, weights: Tensor<2>, level: &Arc<GraphLevel>) -> Tensor<2> {
    binary(x, weights, GraphConvKernel(level.clone()))
}

/// Returns the number of channels of the one-hot depth.
pub fn type_channels(level: &GraphLevel) -> usize {
    type_channels_of(level.types.count)
}

/// Returns the number of one-hot channels for nodes of `depths` different depths.
pub(crate) fn type_channels_of(depths: usize) -> usize {
    if depths > 1 { depths } else { 0 }
}

/// Reference implementation with burn's operations.
#[cfg(test)]
fn composed(x: Tensor<2>, weights: Tensor<2>, level: &GraphLevel) -> Tensor<2> {
    use burn::tensor::{IndexingUpdateOp, Int, TensorData};
    use lo_dual::Direction;

    let (device, dtype, graph) = (x.device(), x.dtype(), &level.graph);
    let floats =
        |values: Vec<f64>, size: [usize; 2]| Tensor::<2>::from_data(TensorData::new(values, size), (&device, dtype));
    let types = type_channels(level);
    let x = if types > 0 {
        let full_depth = graph.depth() + 1 - types as u32;
        let one_hot = graph
            .nodes()
            .iter()
            .flat_map(|node| (0..types).map(move |t| f64::from(node.depth == full_depth + t as u32)));
        Tensor::cat(vec![x, floats(one_hot.collect(), [graph.len(), types])], 1)
    } else {
        x
    };
    let [nodes, channels] = x.dims();
    let (mut segments, mut shares) = (Vec::new(), Vec::new());
    for node in 0..nodes {
        for direction in Direction::ALL {
            let count = graph.neighbours(node, direction).len();
            segments.extend(std::iter::repeat_n((6 * node + direction as usize) as i64, count));
            shares.extend(std::iter::repeat_n(1.0 / count as f64, count));
        }
    }
    let edges = shares.len();
    let columns: Vec<i64> = graph.columns().iter().map(|&c| i64::from(c)).collect();
    let indices = |values: Vec<i64>| Tensor::<1, Int>::from_data(TensorData::new(values, [edges]), &device);
    let gathered = x.clone().select(0, indices(columns)) * floats(shares, [edges, 1]);
    let zeros = Tensor::<2>::zeros([6 * nodes, channels], (&device, dtype));
    let means = zeros.select_assign(0, indices(segments), gathered, IndexingUpdateOp::Add);
    Tensor::cat(vec![means.reshape([nodes, 6 * channels]), x], 1).matmul(weights)
}

/// [`graph_conv`] on slices, with the kernels of `lo_dual`.
#[derive(Clone, Debug)]
struct GraphConvKernel(Arc<GraphLevel>);

impl GraphConvKernel {
    fn inputs(&self, sizes: &[[usize; 2]]) -> usize {
        let [[nodes, inputs], [rows, _]] = *sizes else { panic!("a convolution has features and weights") };
        assert_eq!(nodes, self.0.len(), "one row of features for each node");
        assert_eq!(rows, EDGE_TYPES * (inputs + type_channels(&self.0)), "weights for seven edge types");
        inputs
    }

    /// Splits the weights into those of the features, `[7, in, out]`, and of the depths, `[7, depths, out]`.
    fn split_weights<T: Number>(&self, weights: &[T], inputs: usize, outputs: usize) -> (Vec<T>, Vec<T>) {
        let (mut own, mut types) = (Vec::new(), Vec::new());
        for edge in weights.chunks_exact((inputs + type_channels(&self.0)) * outputs) {
            let (a, b) = edge.split_at(inputs * outputs);
            own.extend_from_slice(a);
            types.extend_from_slice(b);
        }
        (own, types)
    }

    /// Returns what the depths add to the output, for each distinct row of [`NodeTypes`](crate::graph::NodeTypes).
    fn type_rows<T: Number>(&self, weights: &[T], outputs: usize) -> Vec<T> {
        let shares = self.0.types.shares.chunks_exact(EDGE_TYPES * self.0.types.count);
        let mut rows = vec![T::default(); shares.len() * outputs];
        for (shares, row) in shares.zip(rows.chunks_exact_mut(outputs)) {
            for (&share, weights) in shares.iter().zip(weights.chunks_exact(outputs)).filter(|(share, _)| **share > 0.0)
            {
                let share = T::from_f64(share);
                row.iter_mut().zip(weights).for_each(|(sum, &weight)| *sum += share * weight);
            }
        }
        rows
    }

    /// Returns the gradient of the depths' weights.
    fn type_gradient<T: Number>(&self, gradient: &[T], outputs: usize) -> Vec<T> {
        let types = &self.0.types;
        let width = EDGE_TYPES * types.count;
        let different = types.shares.len() / width;
        let parts: Vec<Vec<T>> = types
            .rows
            .par_chunks(PART_ROWS)
            .zip(gradient.par_chunks(PART_ROWS * outputs))
            .map(|(rows, gradient)| {
                let mut sums = vec![T::default(); different * outputs];
                for (&row, gradient) in rows.iter().zip(gradient.chunks_exact(outputs)) {
                    let sums = &mut sums[row as usize * outputs..][..outputs];
                    sums.iter_mut().zip(gradient).for_each(|(sum, &g)| *sum += g);
                }
                sums
            })
            .collect();
        let mut by_weights = vec![T::default(); width * outputs];
        for sums in parts {
            for (shares, sums) in types.shares.chunks_exact(width).zip(sums.chunks_exact(outputs)) {
                for (&share, by_weights) in
                    shares.iter().zip(by_weights.chunks_exact_mut(outputs)).filter(|(s, _)| **s > 0.0)
                {
                    let share = T::from_f64(share);
                    by_weights.iter_mut().zip(sums).for_each(|(total, &sum)| *total += share * sum);
                }
            }
        }
        by_weights
    }
}

impl Kernel for GraphConvKernel {
    fn output_size(&self, sizes: &[[usize; 2]]) -> [usize; 2] {
        self.inputs(sizes);
        [sizes[0][0], sizes[1][1]]
    }

    fn forward<T: Number>(&self, inputs: &[&[T]], sizes: &[[usize; 2]]) -> Vec<T> {
        let (channels, outputs) = (self.inputs(sizes), sizes[1][1]);
        let graph = &self.0.graph;
        if type_channels(&self.0) == 0 {
            return lo_dual::graph_conv(graph, inputs[0], inputs[1], [channels, outputs]);
        }
        let (own, types) = self.split_weights(inputs[1], channels, outputs);
        let rows = self.type_rows(&types, outputs);
        graph_conv_onto(graph, inputs[0], &own, [channels, outputs], |node, output| {
            output.copy_from_slice(&rows[self.0.types.rows[node] as usize * outputs..][..outputs]);
        })
    }

    fn backward<T: Number>(
        &self,
        inputs: &[&[T]],
        sizes: &[[usize; 2]],
        gradient: &[T],
        _wanted: &[bool],
    ) -> Vec<Vec<T>> {
        let (channels, outputs) = (self.inputs(sizes), sizes[1][1]);
        let graph = &self.0.graph;
        if type_channels(&self.0) == 0 {
            let (by_input, by_weights) =
                graph_conv_backward(graph, inputs[0], inputs[1], gradient, [channels, outputs]);
            return vec![by_input, by_weights];
        }
        let (own, _) = self.split_weights(inputs[1], channels, outputs);
        let (by_input, by_own) = graph_conv_backward(graph, inputs[0], &own, gradient, [channels, outputs]);
        let by_types = self.type_gradient(gradient, outputs);
        let edges =
            by_own.chunks_exact(channels * outputs).zip(by_types.chunks_exact(type_channels(&self.0) * outputs));
        vec![by_input, edges.flat_map(|(own, types)| own.iter().chain(types).copied()).collect()]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::graph::level::tests::uneven_octree;
    use crate::testing::{assert_gradients, assert_same_function};

    #[test]
    fn kernel_equals_reference() {
        for level in GraphLevel::all(&uneven_octree()) {
            let sizes = [[level.len(), 5], [7 * (5 + type_channels(&level)), 6]];
            assert_same_function(&sizes, |[x, w]| graph_conv(x, w, &level), |[x, w]| composed(x, w, &level));
        }
    }

    #[test]
    fn gradients_equal_finite_differences() {
        let level = GraphLevel::all(&uneven_octree()).pop().expect("a level");
        assert_gradients(&[[level.len(), 4], [7 * (4 + type_channels(&level)), 3]], |[x, w]| graph_conv(x, w, &level));
    }
}
