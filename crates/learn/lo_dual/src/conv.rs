//! Graph convolution: the neighbours' mean features per direction and the node's own features, times a weight matrix.
//!
//! Means are gathered in blocks of rows that fit a core's cache and are multiplied at once, so that the seven-fold
//! features are never stored as a whole. The backward pass gathers along the transposed edges: a neighbour's neighbour
//! across the opposite face is the node itself. Both gradients are thus matrix products, without scattering, and every
//! sum has a fixed order.

use rayon::prelude::*;

use crate::real::{Matrix, matmul};
use crate::{Direction, DualGraph, Real};

/// Number of edge types: six directions and the self loop.
pub const EDGE_TYPES: usize = 7;

/// Rows gathered at a time.
const BLOCK: usize = 512;

/// Number of partial sums of the weight gradient. Fixed, so that results do not depend on the number of threads.
const PARTS: usize = 32;

/// Convolves `input[nodes, in]` with `weights[7 · in, out]` (Wang et al. 2022, equation 2; `ognn`'s layout). Returns
/// `output[nodes, out]`.
///
/// A node's row of `7 · in` values holds the means per direction, in the order of [`Direction`], then the node's own
/// features.
///
/// # Panics
/// Where the lengths do not match.
pub fn graph_conv<T: Real>(graph: &DualGraph, input: &[T], weights: &[T], size: [usize; 2]) -> Vec<T> {
    let mut output = vec![T::default(); graph.len() * size[1]];
    convolve(graph, input, weights, size, &mut output, None::<fn(usize, &mut [T])>);
    output
}

/// Adds [`graph_conv`] to initial values, which `start` writes into each node's row of `out` values.
///
/// Products of features that many nodes share can thus be computed once.
///
/// # Panics
/// Where the lengths do not match.
pub fn graph_conv_onto<T: Real>(
    graph: &DualGraph,
    input: &[T],
    weights: &[T],
    size: [usize; 2],
    start: impl Fn(usize, &mut [T]) + Sync,
) -> Vec<T> {
    let mut output = vec![T::default(); graph.len() * size[1]];
    convolve(graph, input, weights, size, &mut output, Some(start));
    output
}

fn convolve<T: Real>(
    graph: &DualGraph,
    input: &[T],
    weights: &[T],
    [inputs, outputs]: [usize; 2],
    output: &mut [T],
    start: Option<impl Fn(usize, &mut [T]) + Sync>,
) {
    check(graph, input.len(), inputs);
    assert_eq!(weights.len(), EDGE_TYPES * inputs * outputs, "weights for seven edge types");
    output.par_chunks_mut(BLOCK * outputs).enumerate().for_each_init(
        || vec![T::default(); BLOCK * EDGE_TYPES * inputs],
        |buffer, (block, output)| {
            let rows = output.len() / outputs;
            let buffer = &mut buffer[..rows * EDGE_TYPES * inputs];
            gather(graph, input, inputs, block * BLOCK, buffer, Gather::Mean);
            if let Some(start) = &start {
                for (row, output) in output.chunks_exact_mut(outputs).enumerate() {
                    start(block * BLOCK + row, output);
                }
            }
            let gathered = Matrix::new(buffer, EDGE_TYPES * inputs);
            matmul(output, gathered, Matrix::new(weights, outputs), start.is_some());
        },
    );
}

/// Returns the gradients of [`graph_conv`]'s input and weights from that of its output.
///
/// # Panics
/// Where the lengths do not match.
pub fn graph_conv_backward<T: Real>(
    graph: &DualGraph,
    input: &[T],
    weights: &[T],
    output_gradient: &[T],
    [inputs, outputs]: [usize; 2],
) -> (Vec<T>, Vec<T>) {
    check(graph, input.len(), inputs);
    check(graph, output_gradient.len(), outputs);
    let turned = exchanged(weights, [EDGE_TYPES, inputs, outputs]);
    let mut input_gradient = vec![T::default(); input.len()];
    let part_rows = graph.len().div_ceil(PARTS).next_multiple_of(BLOCK);
    let parts: Vec<Vec<T>> = input_gradient
        .par_chunks_mut(part_rows * inputs)
        .enumerate()
        .map(|(part, input_gradient)| {
            let mut buffer = vec![T::default(); BLOCK * EDGE_TYPES * outputs];
            // [in, 7 · out]
            let mut weight_gradient = vec![T::default(); weights.len()];
            for (block, input_gradient) in input_gradient.chunks_mut(BLOCK * inputs).enumerate() {
                let (first, rows) = (part * part_rows + block * BLOCK, input_gradient.len() / inputs);
                let buffer = &mut buffer[..rows * EDGE_TYPES * outputs];
                gather(graph, output_gradient, outputs, first, buffer, Gather::TransposedMean);
                let gathered = Matrix::new(buffer, EDGE_TYPES * outputs);
                matmul(input_gradient, gathered, Matrix::new(&turned, inputs), false);
                let rows = Matrix::new(&input[first * inputs..][..rows * inputs], inputs);
                matmul(&mut weight_gradient, rows.transposed(), gathered, true);
            }
            weight_gradient
        })
        .collect();
    let mut sum = vec![T::default(); weights.len()];
    for part in parts {
        sum.iter_mut().zip(part).for_each(|(sum, value)| *sum += value);
    }
    // From [in, 7, out] to [7, in, out].
    let mut weight_gradient = Vec::with_capacity(sum.len());
    for edge in 0..EDGE_TYPES {
        for row in sum.chunks_exact(EDGE_TYPES * outputs) {
            weight_gradient.extend_from_slice(&row[edge * outputs..][..outputs]);
        }
    }
    (input_gradient, weight_gradient)
}

fn check(graph: &DualGraph, values: usize, channels: usize) {
    assert!(channels > 0, "features have channels");
    assert_eq!(values, graph.len() * channels, "one row of features for each node of the graph");
}

/// Transposes the last two axes: `[a, b, c]` → `[a, c, b]`.
fn exchanged<T: Real>(values: &[T], [_, b, c]: [usize; 3]) -> Vec<T> {
    let matrices = values.chunks_exact(b * c);
    matrices.flat_map(|matrix| (0..c).flat_map(move |j| (0..b).map(move |i| matrix[i * c + j]))).collect()
}

/// Direction in which features pass along edges.
#[derive(Clone, Copy, PartialEq)]
enum Gather {
    /// Entry `d` is the mean over the node's neighbours in direction `d`.
    Mean,
    /// Entry `d` sums the node's shares of other nodes' means in direction `d`.
    TransposedMean,
}

/// Fills `buffer[rows, 7, channels]` for the rows from `first` on.
fn gather<T: Real>(graph: &DualGraph, x: &[T], channels: usize, first: usize, buffer: &mut [T], kind: Gather) {
    for (row, buffer) in buffer.chunks_exact_mut(EDGE_TYPES * channels).enumerate() {
        let node = first + row;
        let (edges, own) = buffer.split_at_mut(6 * channels);
        own.copy_from_slice(&x[node * channels..][..channels]);
        for (direction, entry) in Direction::ALL.into_iter().zip(edges.chunks_exact_mut(channels)) {
            let (neighbours, share_of) = match kind {
                Gather::Mean => (graph.neighbours(node, direction), None),
                Gather::TransposedMean => (graph.neighbours(node, direction.opposite()), Some(direction)),
            };
            let share = |neighbour: u32| match share_of {
                None => T::reciprocal(neighbours.len() as u32),
                Some(direction) => T::reciprocal(graph.neighbours(neighbour as usize, direction).len() as u32),
            };
            match neighbours {
                [] => entry.fill(T::default()),
                &[one] => {
                    let (features, share) = (&x[one as usize * channels..][..channels], share(one));
                    if share == T::ONE {
                        entry.copy_from_slice(features);
                    } else {
                        entry.iter_mut().zip(features).for_each(|(entry, &feature)| *entry = share * feature);
                    }
                }
                many => {
                    entry.fill(T::default());
                    for &neighbour in many {
                        let (features, share) = (&x[neighbour as usize * channels..][..channels], share(neighbour));
                        entry.iter_mut().zip(features).for_each(|(entry, &feature)| *entry += share * feature);
                    }
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::graph::test_octree;

    fn values(count: usize, seed: f64) -> Vec<f64> {
        (0..count).map(|i| (1.7 * i as f64 + seed).sin() + 0.3 * (0.37 * i as f64 * seed).cos()).collect()
    }

    /// Computes the definition: sums over all edges for each node and output.
    fn defined(graph: &DualGraph, input: &[f64], weights: &[f64], [inputs, outputs]: [usize; 2]) -> Vec<f64> {
        let mut output = vec![0.0; graph.len() * outputs];
        for node in 0..graph.len() {
            for edge in 0..EDGE_TYPES {
                let own = [node as u32];
                let from = if edge == 6 { &own } else { graph.neighbours(node, Direction::ALL[edge]) };
                for &other in from {
                    for i in 0..inputs {
                        let x = input[other as usize * inputs + i] / from.len() as f64;
                        for o in 0..outputs {
                            output[node * outputs + o] += x * weights[(edge * inputs + i) * outputs + o];
                        }
                    }
                }
            }
        }
        output
    }

    #[test]
    fn forward_is_the_definition() {
        let graph = DualGraph::all(&test_octree()).pop().expect("a graph");
        let size = [5, 3];
        let (input, weights) = (values(graph.len() * 5, 0.3), values(7 * 15, 1.1));
        let expected = defined(&graph, &input, &weights, size);
        let output = graph_conv(&graph, &input, &weights, size);
        assert!(output.iter().zip(&expected).all(|(a, b)| (a - b).abs() < 1e-12));
        let single = |values: &[f64]| values.iter().map(|&v| v as f32).collect::<Vec<f32>>();
        let output = graph_conv(&graph, &single(&input), &single(&weights), size);
        assert!(output.iter().zip(&expected).all(|(a, b)| (f64::from(*a) - b).abs() < 1e-5));
    }

    #[test]
    fn starts_are_added() {
        let graph = DualGraph::all(&test_octree()).pop().expect("a graph");
        let (input, weights) = (values(graph.len() * 5, 0.3), values(7 * 15, 1.1));
        let start = |row: usize, channel: usize| (row as f64 * 0.7 + channel as f64).sin();
        let write = |row: usize, output: &mut [f64]| (0..3).for_each(|channel| output[channel] = start(row, channel));
        let onto = graph_conv_onto(&graph, &input, &weights, [5, 3], write);
        let bare = graph_conv(&graph, &input, &weights, [5, 3]);
        assert!((0..onto.len()).all(|i| (onto[i] - bare[i] - start(i / 3, i % 3)).abs() < 1e-12));
    }

    #[test]
    fn backward_is_the_derivative() {
        let graph = DualGraph::all(&test_octree()).pop().expect("a graph");
        let size = [4, 6];
        let (input, weights) = (values(graph.len() * 4, 0.3), values(7 * 24, 1.1));
        let output_gradient = values(graph.len() * 6, 2.3);
        let (by_input, by_weights) = graph_conv_backward(&graph, &input, &weights, &output_gradient, size);
        let sum = |input: &[f64], weights: &[f64]| -> f64 {
            graph_conv(&graph, input, weights, size).iter().zip(&output_gradient).map(|(y, g)| y * g).sum()
        };
        // The function is linear in each argument, so differences with a large step are exact.
        let difference = |of: &dyn Fn(f64) -> f64| 0.5 * (of(1.0) - of(-1.0));
        for index in (0..input.len()).step_by(input.len() / 60) {
            let at = |step: f64| {
                let mut moved = input.clone();
                moved[index] += step;
                sum(&moved, &weights)
            };
            let (got, expected) = (by_input[index], difference(&at));
            assert!((got - expected).abs() < 1e-9 * (1.0 + expected.abs()), "input {index}: {got} {expected}");
        }
        for index in 0..weights.len() {
            let at = |step: f64| {
                let mut moved = weights.clone();
                moved[index] += step;
                sum(&input, &moved)
            };
            let (got, expected) = (by_weights[index], difference(&at));
            assert!((got - expected).abs() < 1e-9 * (1.0 + expected.abs()), "weight {index}: {got} {expected}");
        }
    }

    #[test]
    fn results_do_not_depend_on_thread_count() {
        let graph = DualGraph::all(&test_octree()).pop().expect("a graph");
        let x: Vec<f32> = values(graph.len() * 8, 0.3).iter().map(|&v| v as f32).collect();
        let w: Vec<f32> = values(7 * 64, 1.1).iter().map(|&v| v as f32).collect();
        let run = |threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a pool");
            pool.install(|| (graph_conv(&graph, &x, &w, [8, 8]), graph_conv_backward(&graph, &x, &w, &x, [8, 8])))
        };
        assert_eq!(run(1), run(3));
    }
}
