//! Agreement of octree structure with the truth.

use lo_octree::{LightOctree, Octree};
use serde::Serialize;

/// Agreement of split labels over the nodes from the full depth to the last level but one.
///
/// Occupied leaves of the estimate count as split: the metric rates surfaces, not resolution.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct SplitAgreement {
    /// Share of the true tree's nodes with equal labels in both trees. A node that the estimate lacks counts as not
    /// split.
    pub accuracy: f64,
    /// Share of the estimate's split nodes that are split in the true tree.
    pub precision: f64,
    /// Share of the true tree's split nodes that are split in the estimate.
    pub recall: f64,
}

impl SplitAgreement {
    /// Compares two trees over the same cube.
    ///
    /// `None` if their cubes, depths or full depths differ, or one of them has no split node.
    pub fn compare(truth: &LightOctree, got: &LightOctree) -> Option<Self> {
        let shape = |light: &LightOctree| (light.cube, light.octree.depth(), light.octree.full_depth());
        if shape(truth) != shape(got) {
            return None;
        }
        let (mut nodes, mut agree, mut both) = (0usize, 0usize, 0usize);
        let [mut split_truth, mut split_got] = [0usize; 2];
        for depth in truth.octree.full_depth()..truth.octree.depth() {
            let occupied = occupied_keys(&got.octree, depth);
            split_got += occupied.len();
            let level = &truth.octree.levels()[depth as usize];
            for (key, &child) in level.keys.iter().zip(&level.children) {
                let (is_split, predicted) = (child >= 0, occupied.binary_search(key).is_ok());
                nodes += 1;
                agree += usize::from(is_split == predicted);
                split_truth += usize::from(is_split);
                both += usize::from(is_split && predicted);
            }
        }
        let share = |part: usize, whole: usize| part as f64 / whole as f64;
        (split_truth > 0 && split_got > 0).then(|| Self {
            accuracy: share(agree, nodes),
            precision: share(both, split_got),
            recall: share(both, split_truth),
        })
    }
}

/// Returns the keys of the occupied nodes, in increasing order.
///
/// Leaves at the full depth are excluded: they fill the cube's sides and do not represent surfaces.
fn occupied_keys(octree: &Octree, depth: u32) -> Vec<u32> {
    let level = &octree.levels()[depth as usize];
    let occupied = |node: &usize| level.rows[*node] >= 0 && (depth > octree.full_depth() || level.children[*node] >= 0);
    (0..level.len()).filter(occupied).map(|node| level.keys[node]).collect()
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use lo_geometry::{Cube, Vec3};
    use lo_octree::key_from_xyz;

    /// Builds an octree with leaves of depth 3 at these coordinates, full down to depth 1.
    fn tree(leaves: &[[u32; 3]]) -> LightOctree {
        let mut keys: Vec<u32> = leaves.iter().map(|&[x, y, z]| key_from_xyz([x, y, z])).collect();
        keys.sort_unstable();
        let count = keys.len();
        let cube = Cube::centred(Vec3::ZERO, 8.0);
        LightOctree::from_leaves(keys, vec![[1.0; 4]; count], vec![0; count], cube, 3, 1).unwrap()
    }

    #[test]
    fn labels_are_counted() {
        // Truth: octants 000 and 111 of depth 1 are split, and one node of depth 2 in each.
        let truth = tree(&[[0, 0, 0], [7, 7, 7]]);
        assert_eq!(SplitAgreement::compare(&truth, &truth).unwrap().accuracy, 1.0);
        // MethodOutput: the first octant is equal, octant 100 is split instead of 111.
        let got = tree(&[[0, 0, 0], [7, 0, 0]]);
        let found = SplitAgreement::compare(&truth, &got).unwrap();
        // Depth 1: 8 nodes, 2 wrong. Depth 2: 16 nodes, of which only the split one in octant 111 is wrong.
        assert_eq!(found, SplitAgreement { accuracy: 21.0 / 24.0, precision: 0.5, recall: 0.5 });
        let elsewhere = LightOctree { cube: Cube::centred(Vec3::ZERO, 9.0), ..truth.clone() };
        assert_eq!(SplitAgreement::compare(&truth, &elsewhere), None);
    }
}
