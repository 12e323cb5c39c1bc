//! Points → octree, without and with the neighbour tables: the work of `octree_build_*` in the peers' benchmark.
//!
//! `PEERS_INPUT` names a folder with the peers' clouds (`rgbd_unit.npy`, `rgbd_color.npy`, `room_*`); without it, a box room
//! with as many points stands in. `RAYON_NUM_THREADS` sets the threads.

use std::path::Path;

use divan::{Bencher, black_box};
use geometry::{Cube, Vec3};
use lightoctree_octree::{Coverage, LightOctree, RadiancePoint};

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

/// Points in scattered order on the six walls of a room.
fn box_room(count: usize) -> Vec<[f32; 3]> {
    (0..count)
        .map(|i| {
            // plastic-number sequence in three dimensions (Roberts 2018); the first coordinate picks the wall
            let [wall, u, v] =
                [0.819_172_513_4, 0.671_043_606_7, 0.549_700_477_9f64].map(|a| (0.5 + a * i as f64).fract());
            let wall = (6.0 * wall) as usize;
            let mut unit = [u as f32, v as f32, (wall % 2) as f32];
            unit.rotate_right(wall / 2);
            [0.95 * (2.0 * unit[0] - 1.0), 0.5 * (2.0 * unit[1] - 1.0), 0.75 * (2.0 * unit[2] - 1.0)]
        })
        .collect()
}
