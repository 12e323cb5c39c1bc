//! Points → octree, without and with the neighbour tables: the work of `octree_build_*` in the peers' benchmark.
//!
//! `PEERS_INPUT` names a folder with the peers' clouds (`rgbd_unit.npy`, `rgbd_color.npy`, `room_*`); without it, a box room
//! with as many points stands in. `RAYON_NUM_THREADS` sets the threads.

use std::path::Path;

use divan::{AllocProfiler, Bencher, black_box};
use geometry::{Cube, Vec3};
use lightoctree_octree::{Coverage, LightOctree, RadiancePoint};

#[global_allocator]
static ALLOCATOR: AllocProfiler = AllocProfiler::system();

/// The peers' cube, [−1, 1]³.
const CUBE: Cube = Cube { origin_m: Vec3::splat(-1.0), edge_m: 2.0 };
const FULL_DEPTH: u32 = 4;

fn main() {
    divan::main();
}

#[divan::bench(args = [("rgbd", 6), ("rgbd", 7), ("rgbd", 8), ("room", 6), ("room", 7), ("room", 8)])]
fn build(bencher: Bencher, (cloud, depth): (&str, u32)) {
    let points = cloud_points(cloud);
    bencher.bench(|| LightOctree::from_points(black_box(&points), CUBE, depth, FULL_DEPTH));
}

#[divan::bench(args = [("rgbd", 6), ("rgbd", 7), ("rgbd", 8), ("room", 6), ("room", 7), ("room", 8)])]
fn build_with_neighbours(bencher: Bencher, (cloud, depth): (&str, u32)) {
    let points = cloud_points(cloud);
    bencher.bench(|| {
        let (light, _) = LightOctree::from_points(black_box(&points), CUBE, depth, FULL_DEPTH).expect("valid depths");
        let neighbours = light.octree.all_neighbours();
        (light, neighbours)
    });
}

fn cloud_points(cloud: &str) -> Vec<RadiancePoint> {
    let count = if cloud == "rgbd" { 153_600 } else { 1_300_000 };
    let (positions, colours) = match std::env::var_os("PEERS_INPUT") {
        Some(folder) => {
            ["unit", "color"].map(|part| read_vectors(&Path::new(&folder).join(format!("{cloud}_{part}.npy")))).into()
        }
        None => (box_room(count), vec![[0.5; 3]; count]),
    };
    positions
        .into_iter()
        .zip(colours)
        .map(|(position, radiance)| RadiancePoint {
            position_m: Vec3::from(position),
            radiance,
            coverage: Coverage::Seen,
        })
        .collect()
}

fn read_vectors(path: &Path) -> Vec<[f32; 3]> {
    let bytes = std::fs::read(path).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
    let values: Vec<f32> =
        npyz::NpyFile::new(&bytes[..]).and_then(|file| file.into_vec()).expect("an .npy file of f32");
    values.as_chunks().0.to_vec()
}

/// Points in random order on the six walls of a room, as a low-discrepancy sequence.
fn box_room(count: usize) -> Vec<[f32; 3]> {
    (0..count)
        .map(|i| {
            // the plastic-number sequence (Roberts 2018) in three dimensions; the first picks the wall
            let [w, u, v] =
                [0.819_172_513_4, 0.671_043_606_7, 0.549_700_477_9f64].map(|a| (0.5 + a * i as f64).fract());
            let (axis, side) = ((w * 6.0) as usize / 2, (w * 6.0) as usize % 2);
            let mut unit = [u as f32, v as f32, 0.0];
            unit[2] = side as f32;
            unit.rotate_right(axis);
            [0.95, 0.5, 0.75]
                .map(|half: f32| half)
                .into_iter()
                .zip(unit)
                .map(|(h, t)| h * (2.0 * t - 1.0))
                .collect::<Vec<_>>()
        })
        .map(|p| [p[0], p[1], p[2]])
        .collect()
}
