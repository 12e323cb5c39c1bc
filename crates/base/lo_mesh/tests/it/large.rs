//! Meshes of extreme size and shape.

use std::time::Instant;

use lo_geometry::{Ray, Vec3};
use lo_mesh::{LoadOptions, Material, Model, PreparedModel};

/// Peak resident memory of this process in MB (Linux).
fn peak_mb() -> Option<u64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find(|line| line.starts_with("VmHWM"))?;
    line.split_ascii_whitespace().nth(1)?.parse::<u64>().ok().map(|kb| kb / 1024)
}

/// A wavy square of `side` × `side` quads as binary PLY.
fn terrain_ply(side: usize) -> Vec<u8> {
    let (vertices, faces) = ((side + 1) * (side + 1), side * side * 2);
    let mut bytes = format!(
        "ply\nformat binary_little_endian 1.0\nelement vertex {vertices}\nproperty float x\nproperty float y\n\
         property float z\nelement face {faces}\nproperty list uchar int vertex_indices\nend_header\n"
    )
    .into_bytes();
    for i in 0..vertices {
        let (x, z) = ((i % (side + 1)) as f32 / side as f32, (i / (side + 1)) as f32 / side as f32);
        for value in [x, 0.05 * (x * 40.0).sin() * (z * 31.0).cos(), z] {
            bytes.extend(value.to_le_bytes());
        }
    }
    for quad in 0..side * side {
        let a = (quad / side * (side + 1) + quad % side) as u32;
        let (b, c, d) = (a + 1, a + side as u32 + 1, a + side as u32 + 2);
        for face in [[a, c, b], [b, c, d]] {
            bytes.push(3);
            face.iter().for_each(|v| bytes.extend(v.to_le_bytes()));
        }
    }
    bytes
}

/// Prints the figures of the documentation; run with `--ignored --nocapture`.
#[test]
#[ignore = "takes gigabytes and half a minute"]
fn ten_million_triangles() {
    let bytes = terrain_ply(2237);
    let before = peak_mb();
    let start = Instant::now();
    let model = Model::from_ply_bytes(&bytes, &LoadOptions::default()).unwrap();
    eprintln!(
        "{} triangles, {} MB: read in {:.1?}, peak {before:?} → {:?} MB",
        model.triangles.len(),
        bytes.len() >> 20,
        start.elapsed(),
        peak_mb()
    );
    assert!(model.triangles.len() > 10_000_000);
    drop(bytes);
    let start = Instant::now();
    let prepared = PreparedModel::new(model);
    eprintln!("prepared in {:.1?}, peak {:?} MB", start.elapsed(), peak_mb());
    let hit = prepared.intersect(&Ray { origin: Vec3::new(0.5, 1.0, 0.5), direction: Vec3::NEG_Y }, 9.0).unwrap();
    let height = 0.05 * (0.5_f32 * 40.0).sin() * (0.5_f32 * 31.0).cos();
    assert!((1.0 - hit.distance_m - height).abs() < 1e-4);
}

#[test]
fn a_chain_of_growing_triangles_is_deep_but_harmless() {
    // Each triangle is 8 % larger and farther than the previous one: the hierarchy degenerates to a list.
    let positions: Vec<Vec3> = (0..900)
        .flat_map(|i| {
            let size = 1e-16_f32 * 1.08_f32.powi(i);
            [Vec3::new(size, 0.0, 0.0), Vec3::new(size * 1.01, 0.0, 0.0), Vec3::new(size, size * 0.01, 0.0)]
        })
        .collect();
    let triangles = (0..900).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect();
    let model = Model::from_triangles(positions, triangles, Material::default(), &LoadOptions::default()).unwrap();
    let largest = model.bounds().max.x;
    let prepared = PreparedModel::new(model);
    // Past the whole row, just beyond its triangles.
    let ray = Ray { origin: Vec3::new(largest * 2.0, largest * 0.001, largest), direction: Vec3::NEG_Z };
    assert!(prepared.intersect(&ray, f32::INFINITY).is_none());
    let ray = Ray { origin: Vec3::new(largest * 0.9905, largest * 0.0001, 1.0), direction: Vec3::NEG_Z };
    assert!(prepared.intersect(&ray, f32::INFINITY).is_some());
    let along = Ray { origin: Vec3::new(-1.0, 1e-20, 0.0), direction: Vec3::X };
    assert_eq!(prepared.transmittance(&along, f32::INFINITY), 1.0, "edge-on triangles block nothing");
}

#[test]
fn many_equal_triangles_are_harmless() {
    let positions = vec![Vec3::ZERO, Vec3::X, Vec3::Y];
    let model = Model::from_triangles(positions, vec![[0, 1, 2]; 50_000], Material::default(), &LoadOptions::default());
    let prepared = PreparedModel::new(model.unwrap());
    let hit = prepared.intersect(&Ray { origin: Vec3::new(0.2, 0.2, 1.0), direction: Vec3::NEG_Z }, 9.0).unwrap();
    assert_eq!(hit.triangle, 0, "the first of equals, whatever the hierarchy");
}
