//! Building an octree from points, with and without neighbour tables: the work of `octree_build_*` in the peers'
//! benchmark.
//!
//! `PEERS_INPUT` names a folder with the peers' clouds (`rgbd_unit.npy`, `rgbd_color.npy`, `room_*`). Without it, a box
//! room with as many points is used. `RAYON_NUM_THREADS` sets the thread count.

mod cloud;

use divan::{Bencher, black_box};
use lo_geometry::{Cube, Vec3};
use lo_octree::{LightOctree, Provenance, RadiancePoint};

/// The peers' cube, [−1, 1]³.
const CUBE: Cube = Cube { origin_m: Vec3::splat(-1.0), edge_m: 2.0 };
const FULL_DEPTH: u32 = 4;

fn main() {
    divan::main();
}

#[divan::bench(args = [("rgbd", 6), ("rgbd", 7), ("rgbd", 8), ("room", 6), ("room", 7), ("room", 8)])]
fn build(bencher: Bencher, (cloud, depth): (&str, u32)) {
    let points = cloud::points(cloud);
    bencher.bench(|| LightOctree::from_points(black_box(&points), CUBE, depth, FULL_DEPTH));
}

#[divan::bench(args = [("rgbd", 6), ("rgbd", 7), ("rgbd", 8), ("room", 6), ("room", 7), ("room", 8)])]
fn build_with_neighbours(bencher: Bencher, (cloud, depth): (&str, u32)) {
    let points = cloud::points(cloud);
    bencher.bench(|| {
        let (light, _) = LightOctree::from_points(black_box(&points), CUBE, depth, FULL_DEPTH).expect("valid depths");
        let neighbours = light.octree.all_neighbours();
        (light, neighbours)
    });
}
