use serde::Serialize;

use crate::LightOctree;

/// Size of an octree, per level and in total.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct OctreeStats {
    /// Node counts of every level, root first.
    pub levels: Vec<LevelStats>,
    /// Memory of structure and features, in bytes.
    pub bytes: usize,
}

/// Node counts of one level.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct LevelStats {
    /// Depth of the level.
    pub depth: u32,
    /// All nodes.
    pub total: usize,
    /// Nodes with feature rows.
    pub nonempty: usize,
    /// Nodes with children.
    pub split: usize,
}

impl LightOctree {
    /// Counts nodes and bytes.
    pub fn stats(&self) -> OctreeStats {
        let levels = self.octree.levels().iter().zip(0..).map(|(level, depth)| LevelStats {
            depth,
            total: level.len(),
            nonempty: level.nonempty,
            split: level.children.iter().filter(|&&child| child >= 0).count(),
        });
        let levels: Vec<LevelStats> = levels.collect();
        // key, child and row: four bytes each; RGBα: sixteen, observed share: one
        let bytes = levels.iter().map(|level| 12 * level.total + 17 * level.nonempty).sum();
        OctreeStats { levels, bytes }
    }
}
