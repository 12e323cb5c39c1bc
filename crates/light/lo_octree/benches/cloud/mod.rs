//! The peers' point clouds, or a synthetic substitute of the same size. The benches of `crates/light/lo_cone` include
//! this file by path.

use std::path::Path;

use lo_geometry::Vec3;

use super::{Provenance, RadiancePoint};

/// Returns the points of the cloud `rgbd` (153,600) or `room` (1.3 million) in [−1, 1]³.
///
/// `PEERS_INPUT` names the folder with `CLOUD_unit.npy` and `CLOUD_color.npy`. Without it, the points of a bare box
/// room are returned.
pub fn points(cloud: &str) -> Vec<RadiancePoint> {
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
            provenance: Provenance::Observed,
        })
        .collect()
}

fn read_vectors(path: &Path) -> Vec<[f32; 3]> {
    let bytes = std::fs::read(path).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
    let values: Vec<f32> =
        npyz::NpyFile::new(&bytes[..]).and_then(npyz::NpyFile::into_vec).expect("a file of 32-bit floats");
    values.as_chunks().0.to_vec()
}

/// Points in scattered order on the six walls of a room of the peers' proportions.
fn box_room(count: usize) -> Vec<[f32; 3]> {
    (0..count)
        .map(|i| {
            // plastic-number sequence in three dimensions (Roberts 2018); the first coordinate picks the wall
            let [wall, u, v] =
                [0.819_172_513_4, 0.671_043_606_7, 0.549_700_477_9f64].map(|a| (0.5 + a * i as f64).fract());
            let wall = (6.0 * wall) as usize;
            let mut unit = [u as f32, v as f32, (wall % 2) as f32];
            unit.rotate_right(wall / 2);
            [0.98 * (2.0 * unit[0] - 1.0), 0.4725 * (2.0 * unit[1] - 1.0), 0.77 * (2.0 * unit[2] - 1.0)]
        })
        .collect()
}
