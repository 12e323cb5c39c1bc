//! Merging of leaves that a surface merely touches.

use rayon::prelude::*;

use crate::key::{key_from_xyz, xyz_from_key};
use crate::leaves::{Averaged, Leaves};

/// Merges each leaf with fewer than `least` points into its fullest neighbour with at least `least`. Leaves without
/// such a neighbour stay.
pub(crate) fn merge_sparse_leaves(averaged: Averaged, least: u32, depth: u32) -> Averaged {
    let Averaged { leaves, counts } = averaged;
    let receivers: Vec<Option<u32>> =
        (0..counts.len()).into_par_iter().map(|leaf| receiver(&leaves.keys, &counts, leaf, least, depth)).collect();
    // For each leaf: its number of points, and sums over them.
    let mut sums: Vec<(u32, [f64; 4])> = (0..counts.len())
        .map(|leaf| {
            let ([r, g, b, _], count) = (leaves.rgba[leaf], counts[leaf]);
            (count, [r, g, b, f32::from(leaves.seen[leaf])].map(|mean| f64::from(mean) * f64::from(count)))
        })
        .collect();
    for (leaf, receiver) in receivers.iter().enumerate() {
        if let Some(receiver) = *receiver {
            let (count, given) = sums[leaf];
            let (taken, sum) = &mut sums[receiver as usize];
            *taken += count;
            sum.iter_mut().zip(given).for_each(|(sum, given)| *sum += given);
        }
    }
    let mut kept = Averaged { leaves: Leaves::default(), counts: Vec::new() };
    for (leaf, (count, sum)) in sums.into_iter().enumerate().filter(|(leaf, _)| receivers[*leaf].is_none()) {
        let [r, g, b, seen] = sum.map(|sum| sum / f64::from(count));
        kept.leaves.keys.push(leaves.keys[leaf]);
        kept.leaves.rgba.push([r as f32, g as f32, b as f32, leaves.rgba[leaf][3]]);
        kept.leaves.seen.push(seen.round() as u8);
        kept.counts.push(count);
    }
    kept
}

/// Returns the fullest of the neighbours with at least `least` points, for a leaf with fewer; on ties, the first by
/// key.
fn receiver(keys: &[u32], counts: &[u32], leaf: usize, least: u32, depth: u32) -> Option<u32> {
    if counts[leaf] >= least {
        return None;
    }
    let at = xyz_from_key(keys[leaf]).map(i64::from);
    let around = (0..27).filter_map(|i| {
        let place = [at[0] + i / 9 - 1, at[1] + i / 3 % 3 - 1, at[2] + i % 3 - 1];
        let inside = place.iter().all(|c| (0..1 << depth).contains(c));
        inside.then(|| keys.binary_search(&key_from_xyz(place.map(|c| c as u32))).ok()).flatten()
    });
    let fullest = around.max_by(|&a, &b| counts[a].cmp(&counts[b]).then(b.cmp(&a)))?;
    (counts[fullest] >= least).then_some(fullest as u32)
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]

    use lo_geometry::{Cube, Vec3};
    use proptest::prelude::*;

    use super::*;
    use crate::{LightOctree, Provenance, RadiancePoint};

    const CUBE: Cube = Cube { origin_m: Vec3::ZERO, edge_m: 1.0 };

    fn point(position_m: Vec3, radiance: f32) -> RadiancePoint {
        RadiancePoint { position_m, radiance: [radiance; 3], provenance: Provenance::Inferred }
    }

    /// A floor with 16 points per leaf at depth 4, tilted about two axes.
    fn floor(slope: f32) -> Vec<RadiancePoint> {
        let at = |i: usize| (i as f32 + 0.5) / 64.0;
        let places = (0..64 * 64).map(|i| Vec3::new(at(i % 64), 0.0, at(i / 64)));
        places.map(|p| point(p.with_y(0.2 + slope * p.x + 0.5 * slope * p.z), 1.0)).collect()
    }

    #[test]
    fn a_slanted_floor_is_one_leaf_thick() {
        let points = floor(0.3);
        let thick = LightOctree::from_points(&points, CUBE, 4, 2).unwrap().0;
        let thin = LightOctree::from_uniform_points(&points, 1.0 / (64.0 * 64.0), CUBE, 4, 2).unwrap().0;
        let count = |light: &LightOctree| light.octree.levels()[4].nonempty;
        assert!(count(&thick) > 320, "{}", count(&thick));
        assert!((230..=290).contains(&count(&thin)), "{} instead of 256", count(&thin));
    }

    #[test]
    fn thin_things_stay() {
        let points: Vec<RadiancePoint> = (0..64).map(|i| point(Vec3::new(0.51, i as f32 / 64.0, 0.51), 1.0)).collect();
        let pole = LightOctree::from_uniform_points(&points, 1.0 / (64.0 * 64.0), CUBE, 4, 2).unwrap().0;
        assert_eq!(pole, LightOctree::from_points(&points, CUBE, 4, 2).unwrap().0);
    }

    #[test]
    fn the_light_of_a_lamp_in_a_corner_of_a_leaf_is_kept() {
        let mut points = floor(0.0);
        // two points of a lamp just below the leaves of the floor
        points.extend([0.51, 0.52].map(|x| point(Vec3::new(x, 0.187, 0.51), 1000.0)));
        let light = LightOctree::from_uniform_points(&points, 1.0 / (64.0 * 64.0), CUBE, 4, 2).unwrap().0;
        assert_eq!(light.octree.levels()[4].nonempty, 256);
        let brightest = light.rgba[4].iter().map(|rgba| rgba[0]).fold(0.0, f32::max);
        assert!((brightest - 2016.0 / 18.0).abs() < 1e-3, "{brightest}");
    }

    proptest! {
        #[test]
        fn no_light_is_lost(
            places in proptest::collection::vec((0.0..1.0f32, 0.0..1.0f32, 0.0..0.2f32, 0.0..9.0f32), 1..400),
            least in 0u32..9,
        ) {
            let points: Vec<RadiancePoint> = places.iter().map(|&(x, y, z, v)| point(Vec3::new(x, y, z), v)).collect();
            let (averaged, _) = crate::leaves::average_points(&points, CUBE, 3, 1.0);
            let before = averaged.leaves.keys.clone();
            let weak = averaged.counts.iter().filter(|&&n| n < least).count();
            let Averaged { leaves, counts } = merge_sparse_leaves(averaged, least, 3);
            prop_assert!(leaves.keys.is_sorted() && leaves.keys.iter().all(|key| before.contains(key)));
            prop_assert!(leaves.keys.len() >= before.len() - weak);
            prop_assert_eq!(counts.iter().sum::<u32>() as usize, points.len());
            let light: f64 = leaves.rgba.iter().zip(&counts).map(|(c, n)| f64::from(c[0]) * f64::from(*n)).sum();
            let expected: f64 = points.iter().map(|p| f64::from(p.radiance[0])).sum();
            prop_assert!((light - expected).abs() <= 1e-5 * expected.max(1.0), "{} {}", light, expected);
        }
    }
}
