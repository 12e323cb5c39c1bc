//! Tests graph and convolution against `ognn` 1.x by the first author of the dual-octree networks (`golden/make.py`).

use lo_dual::{Direction, DualGraph, graph_conv, graph_conv_backward};
use lo_geometry::{Cube, Vec3};
use lo_octree::{LightOctree, Provenance, RadiancePoint};
use safetensors::SafeTensors;

const GOLDEN: &[u8] = include_bytes!("golden/ognn.safetensors");

fn floats(file: &SafeTensors, name: &str) -> Vec<f32> {
    let bytes = file.tensor(name).expect("the tensor is there").data();
    bytes.as_chunks::<4>().0.iter().map(|&b| f32::from_le_bytes(b)).collect()
}

fn graphs(file: &SafeTensors) -> Vec<DualGraph> {
    let points: Vec<RadiancePoint> = floats(file, "points")
        .as_chunks::<3>()
        .0
        .iter()
        .map(|&p| RadiancePoint { position_m: Vec3::from(p), radiance: [1.0; 3], provenance: Provenance::Observed })
        .collect();
    let cube = Cube { origin_m: Vec3::NEG_ONE, edge_m: 2.0 };
    let (light, _) = LightOctree::from_points(&points, cube, 5, 2).expect("valid depths");
    DualGraph::all(&light.octree)
}

#[test]
fn edges_are_those_of_ognn() {
    let file = SafeTensors::deserialize(GOLDEN).expect("the golden file");
    for graph in graphs(&file) {
        let bytes = file.tensor(&format!("edges.{}", graph.depth())).expect("edges").data();
        let expected: Vec<i32> = bytes.as_chunks::<4>().0.iter().map(|&b| i32::from_le_bytes(b)).collect();
        let mut edges = Vec::new();
        for node in 0..graph.len() {
            for direction in Direction::ALL {
                let neighbours = graph.neighbours(node, direction).iter();
                edges.extend(neighbours.flat_map(|&other| [node as i32, direction as i32, other as i32]));
            }
        }
        assert_eq!(edges, expected, "depth {}", graph.depth());
    }
}

#[test]
fn convolution_and_gradients_are_those_of_ognn() {
    let file = SafeTensors::deserialize(GOLDEN).expect("the golden file");
    let graph = graphs(&file).pop().expect("a graph");
    let (input, weights) = (floats(&file, "input"), floats(&file, "weights"));
    let output = graph_conv(&graph, &input, &weights, [6, 5]);
    let gradient = floats(&file, "output_gradient");
    let (by_input, by_weights) = graph_conv_backward(&graph, &input, &weights, &gradient, [6, 5]);
    for (name, got) in [("output", output), ("input_gradient", by_input), ("weight_gradient", by_weights)] {
        let expected = floats(&file, name);
        assert_eq!(got.len(), expected.len(), "{name}");
        let largest = expected.iter().fold(0.0f32, |a, b| a.max(b.abs()));
        let error = got.iter().zip(&expected).fold(0.0f32, |e, (a, b)| e.max((a - b).abs()));
        assert!(error < 1e-5 * largest, "{name}: {error} of {largest}");
    }
}
