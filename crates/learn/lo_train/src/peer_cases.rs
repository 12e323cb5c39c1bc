//! Tensor benchmarks of the peers' kit: dual graphs, graph convolutions, graph U-Net and DenseNet-121, at the kit's
//! sizes.

use std::hint::black_box;

use burn::module::Module;
use burn::tensor::{Device, Distribution, Tensor};
use lo_dual::{DualGraph, EDGE_TYPES, graph_conv, graph_conv_backward};
use lo_geometry::{Camera, Cube};
use lo_nets::Adam;
use lo_nets::conv::in_pool;
use lo_nets::depth::DenseNet;
use lo_nets::graph::GraphLevel;
use lo_nets::light::{FreeSpace, Growth, LightInput, LightNet, LightNetConfig, LightOutput, NODE_FEATURES};
use lo_octree::{LightOctree, Octree, OctreeError, RadiancePoint};

/// Full depth of the octrees.
const FULL_DEPTH: u32 = 4;

/// Learning rate of the kit's Adam.
const LEARNING_RATE: f64 = 1e-4;

/// A function to time, with its number of graph nodes.
pub struct Work {
    /// Runs one repetition.
    pub run: Box<dyn FnMut()>,
    /// Nodes of the finest graph; `None` without graphs.
    pub nodes: Option<usize>,
}

/// Builds the dual graphs of all depths of an octree.
pub fn graph_build(octree: Octree) -> Work {
    let nodes = DualGraph::all(&octree).last().map(DualGraph::len);
    let run = move || {
        black_box(DualGraph::all(&octree));
    };
    Work { run: Box::new(run), nodes }
}

/// Runs a graph convolution, `channels` to `channels`, on the graph of `depth`.
///
/// `backward` includes the gradients of input and weights.
///
/// # Panics
/// If the octree has no such depth.
pub fn graph_convolution(octree: &Octree, depth: u32, channels: usize, backward: bool) -> Work {
    let graph = DualGraph::all(octree).swap_remove((depth - octree.full_depth()) as usize);
    let x: Vec<f32> = (0..graph.len() * channels).map(|i| (i as f32 * 0.7).sin()).collect();
    let w: Vec<f32> = (0..EDGE_TYPES * channels * channels).map(|i| (i as f32 * 1.3).cos()).collect();
    let (nodes, size) = (Some(graph.len()), [channels, channels]);
    let run = move || {
        let y = graph_conv(&graph, black_box(&x), &w, size);
        if backward {
            black_box(graph_conv_backward(&graph, &x, &w, &x, size));
        }
        black_box(y);
    };
    Work { run: Box::new(run), nodes }
}

/// Runs the light network with the kit's norm on the octree of a point cloud.
///
/// `train` includes a loss of all outputs, the backward pass and a step of Adam. Unlike in the kit, graphs are rebuilt
/// in each repetition.
///
/// # Errors
/// Point clouds without a valid octree.
pub fn graph_unet(points: &[RadiancePoint], cube: Cube, depth: u32, train: bool) -> Result<Work, OctreeError> {
    let config = LightNetConfig { depth, full_depth: FULL_DEPTH, channels_per_group: 1, ..LightNetConfig::default() };
    let (visible, _) = LightOctree::from_points(points, cube, depth, FULL_DEPTH)?;
    let levels = GraphLevel::all(&visible.octree);
    let nodes = levels.last().map_or(0, |level| level.len());
    let input = LightInput {
        levels,
        octree: visible.octree.clone(),
        features: (0..nodes * NODE_FEATURES).map(|i| (0.7 * i as f32).sin()).collect(),
        visible,
        ambient: [0.3; 3],
        map: None,
        free: FreeSpace::new(&[], &Camera::from_hfov_deg(60.0, 480, 320).expect("a plain camera")),
    };
    let device = if train { Device::flex().autodiff() } else { Device::flex() };
    let net = LightNet::new(&config, 1, &device).expect("the default with another norm is valid");
    let output = move |net: &LightNet| {
        net.forward(&input, None, Growth::Truth(&input.octree)).expect("the octree has the network's depths")
    };
    let run: Box<dyn FnMut()> = if train {
        stepping(net, move |net| plain_loss(&output(net)))
    } else {
        Box::new(move || {
            black_box(in_pool(|| output(&net)));
        })
    };
    Ok(Work { run, nodes: Some(nodes) })
}

/// Runs DenseNet-121 at 480 × 320.
///
/// `train` includes the mean square of the features as loss, the backward pass and a step of Adam.
pub fn densenet(train: bool) -> Work {
    let device = if train { Device::flex().autodiff() } else { Device::flex() };
    let net = DenseNet::new(&mut lo_random::stream(1, "bench", 0), &device);
    let photo = Tensor::<4>::random([3, 1, 320, 480], Distribution::Default, &device);
    let run: Box<dyn FnMut()> = if train {
        stepping(net, move |net| {
            let [.., features] = net.forward(photo.clone());
            features.square().mean()
        })
    } else {
        Box::new(move || {
            black_box(in_pool(|| net.forward(photo.clone())));
        })
    };
    Work { run, nodes: None }
}

/// A loss that depends on all outputs.
fn plain_loss(output: &LightOutput) -> Tensor<1> {
    let parts = output.levels.iter().map(|level| {
        let signal = level.light.clone() - 0.5;
        level.logits.clone().square().mean() + signal.square().mean()
    });
    parts.reduce(|a, b| a + b).expect("levels")
}

/// Returns a function that takes one step of Adam per call.
fn stepping<M: Module + Send + Sync + 'static>(
    net: M,
    loss: impl Fn(&M) -> Tensor<1> + Send + Sync + 'static,
) -> Box<dyn FnMut()> {
    let (mut net, mut adam) = (Some(net), Adam::default());
    Box::new(move || {
        in_pool(|| {
            if let Some(before) = net.take() {
                let gradients = loss(&before).backward();
                net = Some(adam.step(before, &gradients, LEARNING_RATE));
            }
        });
    })
}

#[cfg(test)]
mod tests {
    use lo_geometry::Vec3;
    use lo_octree::Provenance;

    use super::*;

    #[test]
    fn every_case_runs_on_the_graph_of_its_depth() -> Result<(), OctreeError> {
        let cube = Cube { origin_m: Vec3::NEG_ONE, edge_m: 2.0 };
        let point = |direction: Vec3| RadiancePoint {
            position_m: 0.6 * direction,
            radiance: [0.5; 3],
            provenance: Provenance::Inferred,
        };
        let points: Vec<RadiancePoint> = lo_geometry::fibonacci_sphere(500).into_iter().map(point).collect();
        let octree = LightOctree::from_points(&points, cube, 5, FULL_DEPTH)?.0.octree;
        let graphs: Vec<usize> = DualGraph::all(&octree).iter().map(DualGraph::len).collect();
        let mut works = vec![
            (graph_build(octree.clone()), graphs[1]),
            (graph_convolution(&octree, 4, 8, false), graphs[0]),
            (graph_convolution(&octree, 5, 8, true), graphs[1]),
            (graph_unet(&points, cube, 5, true)?, graphs[1]),
        ];
        for (work, nodes) in &mut works {
            assert_eq!(work.nodes, Some(*nodes));
            // Twice: the second step uses the state of the first.
            (work.run)();
            (work.run)();
        }
        Ok(())
    }
}
