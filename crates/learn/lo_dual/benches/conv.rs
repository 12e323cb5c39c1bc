//! Benchmarks of dual graphs and graph convolutions: the cases `graph_build_*` and `graph_conv_*` of the peers'
//! benchmark, and plain matrix products of the same sizes.
//!
//! `PEERS_INPUT` names a folder with the peers' point clouds (`rgbd_unit.npy`, `rgbd_color.npy`). By default, a
//! box-shaped room is used. `RAYON_NUM_THREADS` sets the number of threads.

#[path = "../../../light/lo_octree/benches/cloud/mod.rs"]
mod cloud;

use divan::{Bencher, black_box};
use lo_dual::{DualGraph, EDGE_TYPES, graph_conv, graph_conv_backward};
use lo_geometry::{Cube, Vec3};
use lo_octree::{LightOctree, Octree, Provenance, RadiancePoint};

const SIZES: [(u32, usize); 3] = [(7, 32), (6, 64), (5, 128)];

fn main() {
    divan::main();
}

#[divan::bench]
fn graph_build_d7(bencher: Bencher) {
    let octree = cloud_octree();
    bencher.bench(|| DualGraph::all(black_box(&octree)));
}

#[divan::bench(args = SIZES)]
fn conv_forward(bencher: Bencher, (depth, channels): (u32, usize)) {
    let (graph, x, w) = layer(depth, channels);
    bencher.bench(|| graph_conv(&graph, black_box(&x), &w, [channels, channels]));
}

#[divan::bench(args = SIZES)]
fn conv_forward_and_backward(bencher: Bencher, (depth, channels): (u32, usize)) {
    let (graph, x, w) = layer(depth, channels);
    bencher.bench(|| {
        let y = graph_conv(&graph, black_box(&x), &w, [channels, channels]);
        (graph_conv_backward(&graph, &x, &w, &x, [channels, channels]), y)
    });
}

/// Multiplies `[nodes, 7 · channels] × [7 · channels, channels]` on gathered features, on one thread.
#[divan::bench(args = SIZES)]
#[expect(unsafe_code)]
fn bare_product(bencher: Bencher, (depth, channels): (u32, usize)) {
    let (graph, _, w) = layer(depth, channels);
    let (m, n, k) = (graph.len(), channels, EDGE_TYPES * channels);
    let gathered = vec![0.5f32; m * k];
    bencher.bench(|| {
        let mut out = vec![0.0f32; m * n];
        // SAFETY: row-major matrices of these sizes.
        unsafe {
            gemm::gemm(
                m,
                n,
                k,
                out.as_mut_ptr(),
                1,
                n as isize,
                false,
                black_box(&gathered).as_ptr(),
                1,
                k as isize,
                w.as_ptr(),
                1,
                n as isize,
                1.0,
                1.0,
                false,
                false,
                false,
                gemm::Parallelism::None,
            );
        }
        out
    });
}

fn layer(depth: u32, channels: usize) -> (DualGraph, Vec<f32>, Vec<f32>) {
    let graph = DualGraph::all(&cloud_octree()).swap_remove(depth as usize - 4);
    let x = (0..graph.len() * channels).map(|i| (i as f32 * 0.7).sin()).collect();
    let w = (0..EDGE_TYPES * channels * channels).map(|i| (i as f32 * 1.3).cos()).collect();
    (graph, x, w)
}

fn cloud_octree() -> Octree {
    let points = cloud::points("rgbd");
    let cube = Cube { origin_m: Vec3::splat(-1.0), edge_m: 2.0 };
    LightOctree::from_points(&points, cube, 7, 4).expect("valid depths").0.octree
}
