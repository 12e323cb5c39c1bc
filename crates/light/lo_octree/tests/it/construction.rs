//! Octrees built from points, against a naive construction in f64.

use std::collections::BTreeMap;

use lo_geometry::{Cube, Vec3};
use lo_octree::{LightOctree, MAX_ALPHA, Provenance, RadiancePoint, key_from_xyz, xyz_from_key};
use proptest::prelude::*;

const CUBE: Cube = Cube { origin_m: Vec3::new(-1.0, -2.0, -3.0), edge_m: 4.0 };

fn point_in(cube: Cube) -> impl Strategy<Value = RadiancePoint> {
    // Slightly beyond the cube, and clustered so that leaves hold several points.
    (prop::array::uniform3(-0.05f32..1.05), prop::bool::ANY, prop::array::uniform3(0.0f32..20.0), any::<bool>())
        .prop_map(move |(unit, cluster, radiance, seen)| {
            let unit = Vec3::from(unit);
            RadiancePoint {
                position_m: cube.world_from_unit(if cluster { unit * 0.1 } else { unit }),
                radiance,
                provenance: if seen { Provenance::Observed } else { Provenance::Inferred },
            }
        })
}

/// Returns mean radiance, observed share and number of points per leaf.
fn naive_leaves(points: &[RadiancePoint], cube: Cube, depth: u32) -> BTreeMap<u32, ([f64; 3], f64, usize)> {
    let mut leaves: BTreeMap<u32, ([f64; 3], f64, usize)> = BTreeMap::new();
    for point in points.iter().filter(|p| cube.contains(p.position_m)) {
        // in f32, so that points within a rounding of a leaf's face fall on the same side
        let unit = point.position_m - cube.origin_m;
        let scale = (1 << depth) as f32 / cube.edge_m;
        let xyz = unit.to_array().map(|c| ((c * scale).floor() as u32).min((1 << depth) - 1));
        let leaf = leaves.entry(key_from_xyz(xyz)).or_default();
        for (sum, value) in leaf.0.iter_mut().zip(point.radiance) {
            *sum += f64::from(value);
        }
        leaf.1 += f64::from(point.provenance as u8);
        leaf.2 += 1;
    }
    for (sum, seen, count) in leaves.values_mut() {
        sum.iter_mut().for_each(|s| *s /= *count as f64);
        *seen /= *count as f64;
    }
    leaves
}

fn check_structure(light: &LightOctree) {
    let levels = light.octree.levels();
    for (d, level) in levels.iter().enumerate() {
        assert!(level.keys.windows(2).all(|pair| pair[0] < pair[1]), "keys increase");
        let rows: Vec<i32> = level.rows.iter().copied().filter(|&row| row >= 0).collect();
        assert!(rows.iter().enumerate().all(|(i, &row)| row == i as i32), "rows are in node order");
        assert_eq!([rows.len(), light.rgba[d].len(), light.seen[d].len()], [level.nonempty; 3]);
        if d as u32 <= light.octree.full_depth() {
            assert_eq!(level.len(), 1 << (3 * d), "full level");
        }
        let mut next_child = 0;
        for (node, &children) in level.children.iter().enumerate() {
            let split = (d as u32) < light.octree.full_depth() || (level.rows[node] >= 0 && d + 1 < levels.len());
            assert_eq!(children >= 0, split);
            if split {
                assert_eq!(children as usize, next_child);
                let nodes = next_child..next_child + 8;
                assert!(
                    levels[d + 1].keys[nodes.clone()]
                        .iter()
                        .enumerate()
                        .all(|(c, key)| *key == level.keys[node] << 3 | c as u32)
                );
                assert_eq!(levels[d + 1].rows[nodes].iter().any(|&row| row >= 0), level.rows[node] >= 0);
                next_child += 8;
            }
        }
        if d + 1 < levels.len() {
            assert_eq!(next_child, levels[d + 1].len());
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn leaves_hold_the_means_of_their_points(
        points in prop::collection::vec(point_in(CUBE), 0..300),
        depth in 1..=10u32,
        full_depth in 0..=4u32,
    ) {
        let full_depth = full_depth.min(depth);
        let (light, report) = LightOctree::from_points(&points, CUBE, depth, full_depth).unwrap();
        check_structure(&light);
        let expected = naive_leaves(&points, CUBE, depth);
        prop_assert_eq!(report.used, expected.values().map(|leaf| leaf.2).sum::<usize>());
        prop_assert_eq!(report.outside, points.len() - report.used);
        let finest = &light.octree.levels()[depth as usize];
        prop_assert_eq!(finest.nonempty, expected.len());
        for (key, (radiance, seen, _)) in &expected {
            let node = light.octree.find(depth, *key).expect("every occupied leaf exists");
            let row = finest.rows[node] as usize;
            let [r, g, b, a] = light.rgba[depth as usize][row];
            for (got, want) in [r, g, b].into_iter().zip(radiance) {
                // one rounding to f32 after sums in f64
                prop_assert!((f64::from(got) - want).abs() <= 1e-7 * want.abs());
            }
            prop_assert_eq!(a, MAX_ALPHA);
            prop_assert!((f64::from(light.seen[depth as usize][row]) - 255.0 * seen).abs() <= 0.5);
        }
        for point in points.iter().filter(|p| CUBE.contains(p.position_m)) {
            let (found_depth, node) = light.locate(point.position_m, depth).unwrap();
            prop_assert_eq!(found_depth, depth);
            prop_assert!(light.node_rgba(found_depth, node).is_some());
        }
    }

    #[test]
    fn find_agrees_with_binary_search(
        points in prop::collection::vec(point_in(CUBE), 0..60),
        depth in 1..=7u32,
        keys in prop::collection::vec(any::<u32>(), 50),
    ) {
        let (light, _) = LightOctree::from_points(&points, CUBE, depth, depth.min(2)).unwrap();
        for (d, level) in light.octree.levels().iter().enumerate() {
            for key in keys.iter().map(|key| key >> (32 - 3 * d as u32 - 1)).chain(level.keys.iter().copied()) {
                prop_assert_eq!(light.octree.find(d as u32, key), level.keys.binary_search(&key).ok());
            }
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]

    #[test]
    fn neighbours_agree_with_search(
        points in prop::collection::vec(point_in(CUBE), 0..80),
        depth in 1..=8u32,
        full_depth in 0..=3u32,
    ) {
        let (light, _) = LightOctree::from_points(&points, CUBE, depth, full_depth.min(depth)).unwrap();
        let tables = light.octree.all_neighbours();
        prop_assert_eq!(tables.len() as u32, depth + 1);
        for (d, level) in light.octree.levels().iter().enumerate() {
            prop_assert_eq!(&tables[d], &light.octree.neighbours(d as u32));
            prop_assert_eq!(tables[d].len(), level.len());
            for (table, &key) in tables[d].iter().zip(&level.keys) {
                let centre = xyz_from_key(key).map(|c| c as i32);
                for (entry, &neighbour) in table.iter().enumerate() {
                    let offset = [entry / 9, entry / 3 % 3, entry % 3].map(|o| o as i32 - 1);
                    let at = [centre[0] + offset[0], centre[1] + offset[1], centre[2] + offset[2]];
                    let inside = at.iter().all(|&c| (0..1 << d).contains(&c));
                    let found = inside.then(|| key_from_xyz(at.map(|c| c as u32))).and_then(|k| level.keys.binary_search(&k).ok());
                    prop_assert_eq!(neighbour, found.map_or(-1, |node| node as i32));
                }
            }
        }
    }
}

#[test]
fn degenerate_clouds_give_octrees() {
    let at = |position_m| RadiancePoint { position_m, radiance: [1.0, 2.0, 3.0], provenance: Provenance::Observed };
    let (empty, report) = LightOctree::from_points(&[], CUBE, 7, 4).unwrap();
    check_structure(&empty);
    assert_eq!((report.used, empty.octree.levels()[5].len()), (0, 0));

    let (one, _) = LightOctree::from_points(&[at(CUBE.centre_m())], CUBE, 7, 4).unwrap();
    check_structure(&one);
    assert_eq!(
        xyz_from_key(one.octree.levels()[7].keys[one.octree.levels()[7].rows.iter().position(|&r| r == 0).unwrap()]),
        [64; 3]
    );
    assert_eq!(one.rgba[0][0][..3], [1.0, 2.0, 3.0]);

    let many = vec![at(CUBE.centre_m()); 100_000];
    let (same, report) = LightOctree::from_points(&many, CUBE, 7, 4).unwrap();
    assert_eq!((report.used, &same), (100_000, &one));

    let bad = [at(Vec3::NAN), at(Vec3::splat(f32::INFINITY)), at(CUBE.origin_m - 1.0), at(CUBE.origin_m + CUBE.edge_m)];
    let (none, report) = LightOctree::from_points(&bad, CUBE, 7, 4).unwrap();
    assert_eq!((report.used, report.outside, report.not_finite, &none), (0, 2, 2, &empty));
}
