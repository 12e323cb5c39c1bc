//! Octrees with leaves at several depths.

use lo_geometry::Cube;

use crate::light::{check_cube, is_feature};
use crate::pyramid::{Ancestor, LeafRows, pyramid_by_depth};
use crate::topology::check_depths;
use crate::{LightOctree, Octree, OctreeError};

impl LightOctree {
    /// Builds the octree whose leaves of depth `d` are `leaves[d]`, full down to `full_depth`.
    ///
    /// `ancestor` returns the content of a node above the leaves, given its depth and shuffled key.
    ///
    /// # Errors
    /// Depths out of range, a cube without volume, lists of different lengths, keys out of order, features out of
    /// range, leaves above the full depth or below another leaf.
    pub fn from_leaves_by_depth(
        leaves: Vec<LeafRows>,
        cube: Cube,
        full_depth: u32,
        ancestor: impl Fn(u32, u32) -> Ancestor + Sync,
    ) -> Result<Self, OctreeError> {
        check_depths((leaves.len() as u32).saturating_sub(1), full_depth)?;
        check_cube(cube)?;
        for (depth, rows) in (0..).zip(&leaves) {
            check(rows, depth, full_depth)?;
        }
        let keys: Vec<&[u32]> = leaves.iter().map(|rows| &rows.keys[..]).collect();
        let octree = Octree::from_leaf_keys_by_depth(&keys, full_depth)?;
        let (rgba, seen) = pyramid_by_depth(&octree, leaves, ancestor);
        Ok(Self { octree, cube, rgba, seen, lobes: None })
    }
}

fn check(rows: &LeafRows, depth: u32, full_depth: u32) -> Result<(), OctreeError> {
    for (what, got) in [("rgba", rows.rgba.len()), ("seen", rows.seen.len())] {
        if got != rows.keys.len() {
            return Err(OctreeError::Length { what, expected: rows.keys.len(), got });
        }
    }
    for (index, &key) in rows.keys.iter().enumerate() {
        let in_order = index == 0 || rows.keys[index - 1] < key;
        if key >> (3 * depth) != 0 || !in_order || depth < full_depth {
            return Err(OctreeError::LeafKey { index, key, depth });
        }
    }
    match rows.rgba.iter().position(|row| !is_feature(row)) {
        Some(index) => Err(OctreeError::LeafFeature { index, rgba: rows.rgba[index] }),
        None => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use lo_geometry::Vec3;

    use super::*;
    use crate::{Provenance, RadiancePoint};

    const CUBE: Cube = Cube { origin_m: Vec3::ZERO, edge_m: 1.0 };

    fn from_points(depth: u32) -> LightOctree {
        let points: Vec<RadiancePoint> = (0..3000)
            .map(|i| RadiancePoint {
                position_m: Vec3::new(0.5 + 0.4 * (i as f32).sin(), (i as f32 * 0.618).fract(), i as f32 / 3000.0),
                radiance: [1.0 + (i as f32).cos(), 0.5, i as f32],
                provenance: if i % 3 == 0 { Provenance::Observed } else { Provenance::Inferred },
            })
            .collect();
        LightOctree::from_points(&points, CUBE, depth, 2).unwrap().0
    }

    fn leaves_of(light: &LightOctree) -> Vec<LeafRows> {
        let levels = light.octree.levels().iter().enumerate();
        let of_level = levels.map(|(depth, level)| {
            let nodes = (0..level.len()).filter(|&node| level.rows[node] >= 0 && level.children[node] < 0);
            let mut rows = LeafRows::default();
            for node in nodes {
                let row = level.rows[node] as usize;
                rows.keys.push(level.keys[node]);
                rows.rgba.push(light.rgba[depth][row]);
                rows.seen.push(light.seen[depth][row]);
            }
            rows
        });
        of_level.collect()
    }

    #[test]
    fn leaves_of_one_depth_give_the_octree_they_come_from() {
        let light = from_points(5);
        let again = LightOctree::from_leaves_by_depth(leaves_of(&light), CUBE, 2, |_, _| Ancestor::Merged).unwrap();
        assert_eq!(again, light);
    }

    #[test]
    fn a_split_leaf_keeps_everything_else() {
        let light = from_points(5);
        let mut leaves = leaves_of(&light);
        leaves.push(LeafRows::default());
        // the third leaf of depth 5 becomes its eight children
        let key = leaves[5].keys.remove(3);
        let (rgba, seen) = (leaves[5].rgba.remove(3), leaves[5].seen.remove(3));
        for child in 0..8 {
            leaves[6].keys.push(key << 3 | child);
            leaves[6].rgba.push(rgba);
            leaves[6].seen.push(seen);
        }
        let known = |depth: u32, key: u32| {
            let row = light.row(depth, key).unwrap();
            Ancestor::Known(light.rgba[depth as usize][row], light.seen[depth as usize][row])
        };
        let split = LightOctree::from_leaves_by_depth(leaves.clone(), CUBE, 2, known).unwrap();
        assert_eq!((&split.rgba[..6], &split.seen[..6]), (&light.rgba[..], &light.seen[..]));
        assert_eq!((split.rgba[6].len(), split.rgba[6][7]), (8, rgba));
        assert_eq!(split.leaves().count(), light.leaves().count() + 7);
        // its colour is that of its children
        let opacity =
            |depth: u32, key: u32| Ancestor::Opacity(light.rgba[depth as usize][light.row(depth, key).unwrap()][3]);
        let merged = LightOctree::from_leaves_by_depth(leaves.clone(), CUBE, 2, opacity).unwrap();
        for (merged, before) in merged.rgba[5].iter().zip(&light.rgba[5]) {
            assert!(merged.iter().zip(before).all(|(a, b)| (a - b).abs() <= 1e-6 * b.abs()), "{merged:?} {before:?}");
        }
        // a leaf below a leaf, one above the full depth, one out of order
        leaves[5].keys.insert(3, key);
        leaves[5].rgba.insert(3, rgba);
        leaves[5].seen.insert(3, seen);
        let build =
            |leaves: &[LeafRows]| LightOctree::from_leaves_by_depth(leaves.to_vec(), CUBE, 2, |_, _| Ancestor::Merged);
        assert!(matches!(build(&leaves), Err(OctreeError::LeafKey { depth: 5, .. })));
        leaves.pop();
        assert!(build(&leaves).is_ok());
        leaves[5].keys.swap(0, 1);
        assert!(matches!(build(&leaves), Err(OctreeError::LeafKey { index: 1, depth: 5, .. })));
        leaves[5].keys.swap(0, 1);
        leaves[1] = LeafRows { keys: vec![0], rgba: vec![rgba], seen: vec![0] };
        assert!(matches!(build(&leaves), Err(OctreeError::LeafKey { depth: 1, .. })));
    }
}
