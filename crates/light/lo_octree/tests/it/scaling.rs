//! Results do not depend on the thread count; sizes grow with surfaces, not volumes.

use lo_geometry::{Cube, Vec3};
use lo_octree::{LightOctree, Provenance, RadiancePoint, write_tensors};

const CUBE: Cube = Cube { origin_m: Vec3::splat(-1.0), edge_m: 2.0 };

/// Points on the sphere of radius 0.9, in an order unrelated to that of their keys.
fn sphere(count: usize) -> Vec<RadiancePoint> {
    let directions = lo_geometry::fibonacci_sphere(count);
    (0..count)
        .map(|i| {
            let at = i * 7919 % count;
            RadiancePoint {
                position_m: 0.9 * directions[at],
                radiance: [0.1, 1.0 / (1 + at) as f32, (at % 1000) as f32],
                provenance: if at % 5 < 2 { Provenance::Observed } else { Provenance::Inferred },
            }
        })
        .collect()
}

#[test]
fn every_thread_count_gives_the_same_bytes() {
    let points = sphere(100_001);
    for depth in [2, 7, 8] {
        let build = |threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| {
                let (light, report) = LightOctree::from_points(&points, CUBE, depth, 2).unwrap();
                (write_tensors(&light), report, light.octree.all_neighbours())
            })
        };
        let alone = build(1);
        assert_eq!(alone.1.used, points.len());
        for threads in [2, 3, 8] {
            assert!(build(threads) == alone, "depth {depth}, {threads} threads");
        }
    }
}

#[test]
fn a_level_more_takes_about_four_times_the_memory() {
    let points = sphere(2_000_000);
    let bytes = [6, 7, 8].map(|depth| LightOctree::from_points(&points, CUBE, depth, 4).unwrap().0.stats().bytes);
    for pair in bytes.windows(2) {
        let growth = pair[1] as f64 / pair[0] as f64;
        assert!((3.0..4.5).contains(&growth), "{bytes:?}");
    }
}

#[test]
fn statistics_count_what_is_there() {
    let point = |x| RadiancePoint { position_m: Vec3::splat(x), radiance: [1.0; 3], provenance: Provenance::Observed };
    let (light, _) = LightOctree::from_points(&[point(-0.9), point(0.9)], CUBE, 3, 1).unwrap();
    let json = serde_json::to_value(light.stats()).unwrap();
    let expected = serde_json::json!({
        "levels": [
            {"depth": 0, "total": 1, "nonempty": 1, "split": 1},
            {"depth": 1, "total": 8, "nonempty": 2, "split": 2},
            {"depth": 2, "total": 16, "nonempty": 2, "split": 2},
            {"depth": 3, "total": 16, "nonempty": 2, "split": 0},
        ],
        "bytes": 41 * 12 + 7 * 17,
    });
    assert_eq!(json, expected);
}
