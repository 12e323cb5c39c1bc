//! Construction of the octree from its leaves.

use std::collections::HashSet;

use lo_octree::{Ancestor, LeafRows, LightOctree, OctreeError};

use super::leaves::{Leaf, LeafSet};

impl LeafSet {
    /// Builds the octree of these leaves, over the cube of `light`.
    pub fn octree(
        &self,
        light: &LightOctree,
        ancestor: impl Fn(u32, u32) -> Ancestor + Sync,
    ) -> Result<LightOctree, OctreeError> {
        self.octree_with(light, Leaf::final_rgba, ancestor)
    }

    /// Builds an octree of these leaves with other features.
    pub fn octree_with(
        &self,
        light: &LightOctree,
        rgba: impl Fn(&Leaf) -> [f32; 4],
        ancestor: impl Fn(u32, u32) -> Ancestor + Sync,
    ) -> Result<LightOctree, OctreeError> {
        let finest = self.leaves.iter().map(|leaf| leaf.depth).max().unwrap_or(0).max(light.octree.depth());
        let of_depth = |indices: Vec<u32>| {
            let leaves = || indices.iter().map(|&index| &self.leaves[index as usize]);
            LeafRows {
                keys: leaves().map(|leaf| leaf.key).collect(),
                rgba: leaves().map(&rgba).collect(),
                seen: leaves().map(|leaf| if leaf.light.is_some() { 0 } else { leaf.seen }).collect(),
            }
        };
        let leaves = self.by_depth(finest).into_iter().map(of_depth).collect();
        LightOctree::from_leaves_by_depth(leaves, light.cube, light.octree.full_depth(), ancestor)
    }

    /// Replaces `light` by the octree of these leaves, and `confidence` by that of its rows. Where the panorama
    /// contributed the light, confidence is at least `sure` (0 to 1). Returns the panorama's share of each row.
    pub fn finish(
        &self,
        light: &mut LightOctree,
        confidence: Option<&mut Vec<Vec<u8>>>,
        sure: f32,
    ) -> Result<Vec<Vec<u8>>, OctreeError> {
        // Ancestors of leaves that changed, and of leaves that were added or closed.
        let (mut touched, mut grown) = (HashSet::new(), HashSet::new());
        for leaf in self.leaves.iter().filter(|leaf| leaf.open) {
            for up in 1..=leaf.depth {
                let node = (leaf.depth - up, leaf.key >> (3 * up));
                let known = !touched.insert(node);
                if leaf.closing && grown.insert(node) {
                    continue;
                }
                if known {
                    break;
                }
            }
        }
        let before = &*light;
        let ancestor = |depth: u32, key: u32| match before.row(depth, key) {
            Some(row) if !touched.contains(&(depth, key)) => {
                Ancestor::Known(before.rgba[depth as usize][row], before.seen[depth as usize][row])
            }
            Some(row) if !grown.contains(&(depth, key)) => Ancestor::Opacity(before.rgba[depth as usize][row][3]),
            _ => Ancestor::Merged,
        };
        let mut laid = self.octree(before, ancestor)?;
        let indices = self.indices(&laid);
        let leaf_of = |depth: usize, row: usize| self.leaves.get(indices[depth][row] as usize);
        let share =
            above(&laid, |depth, _, row| leaf_of(depth, row).map(|leaf| if leaf.light.is_some() { 255 } else { 0 }));
        if let Some(confidence) = confidence {
            let sure = (255.0 * sure).round() as u8;
            let known = &*confidence;
            let new = above(&laid, |depth, key, row| match leaf_of(depth, row) {
                Some(leaf) if leaf.light.is_some() => Some(leaf.confidence.max(sure)),
                Some(leaf) => Some(leaf.confidence),
                None if touched.contains(&(depth as u32, key)) => None,
                None => before.row(depth as u32, key).map(|row| known[depth][row]),
            });
            *confidence = new;
        }
        if let Some(lobes) = &before.lobes {
            let of_level = |(depth, level): (usize, &lo_octree::Level)| {
                let of_row = |(row, key): (usize, u32)| match leaf_of(depth, row) {
                    Some(leaf) if leaf.light.is_some() => [0.0; 3],
                    Some(leaf) => leaf.lobe,
                    None => before.row(depth as u32, key).map_or([0.0; 3], |old| {
                        let own = 1.0 - f32::from(share[depth][row]) / 255.0;
                        lobes[depth][old].map(|v| own * v)
                    }),
                };
                level.row_keys().enumerate().map(of_row).collect()
            };
            laid.lobes = Some(laid.octree.levels().iter().enumerate().map(of_level).collect());
        }
        *light = laid;
        Ok(share)
    }
}

/// Computes a value for each row of an octree, by depth: `own(depth, key, row)`, else the mean of the node's non-empty
/// children.
fn above(light: &LightOctree, own: impl Fn(usize, u32, usize) -> Option<u8>) -> Vec<Vec<u8>> {
    let levels = light.octree.levels();
    let mut values: Vec<Vec<u8>> = vec![Vec::new(); levels.len()];
    for (depth, level) in levels.iter().enumerate().rev() {
        let nodes = (0..level.len()).filter(|&node| level.rows[node] >= 0);
        let of_node = |node: usize| {
            own(depth, level.keys[node], level.rows[node] as usize).unwrap_or_else(|| {
                let first = level.children[node].max(0) as usize;
                let below = levels.get(depth + 1).map_or(&[][..], |below| &below.rows[first..first + 8]);
                let rows = below.iter().filter_map(|&row| usize::try_from(row).ok());
                let (sum, count) =
                    rows.fold((0, 0), |(sum, count), row| (sum + u32::from(values[depth + 1][row]), count + 1));
                ((sum + count / 2) / count.max(1)) as u8
            })
        };
        let of_level = nodes.map(of_node).collect();
        values[depth] = of_level;
    }
    values
}
