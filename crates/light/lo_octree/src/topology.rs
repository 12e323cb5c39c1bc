use rayon::prelude::*;

use crate::{MAX_DEPTH, MAX_FULL_DEPTH, OctreeError};

/// Structure of a sparse voxel octree, without features.
///
/// Full down to `full_depth`, sparse below. Nodes of one depth are in shuffled-key (Morton) order; the eight children
/// of a split node are adjacent. A node is *non-empty* when it has a feature row. Rows of one depth are in node order.
///
/// Nodes above `full_depth` are split even when empty. From `full_depth` on, only non-empty nodes are split, and the
/// parent of a non-empty node is non-empty. In an octree built from points, every non-empty node above the finest depth
/// is split. In a [grown](Octree::grow) octree, a non-empty node may be a leaf at any depth from `full_depth` on.
#[derive(Clone, Debug, PartialEq)]
pub struct Octree {
    full_depth: u32,
    /// `levels[d]` holds the nodes of depth `d`; the last one is the octree's depth.
    levels: Vec<Level>,
}

/// All nodes of one depth.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Level {
    /// Shuffled key of each node: bits of x, y, z interleaved, x highest, `3 · depth` bits.
    pub keys: Vec<u32>,
    /// Index of the node's first child in the next level, or −1 where the node is not split.
    pub children: Vec<i32>,
    /// Feature row of the node in this level, or −1 where the node is empty.
    pub rows: Vec<i32>,
    /// Number of non-empty nodes.
    pub nonempty: usize,
}

/// A node that is neither empty nor split.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LeafNode {
    /// Depth of the node.
    pub depth: u32,
    /// Index of the node in its level.
    pub node: usize,
    /// Feature row of the node in its level.
    pub row: usize,
}

impl Octree {
    /// Returns the octree of depth `full_depth` (at most [`MAX_FULL_DEPTH`]) in which every node exists and is empty.
    /// Growth starts from it.
    pub fn full(full_depth: u32) -> Result<Self, OctreeError> {
        check_depths(MAX_DEPTH, full_depth)?;
        let levels = (0..=full_depth).map(|depth| Level::new(full_keys(depth), depth < full_depth)).collect();
        Ok(Self { full_depth, levels })
    }

    /// Builds the octree with non-empty leaves at `depth`. `leaf_keys` are strictly increasing; ancestors of leaves are
    /// non-empty too.
    pub(crate) fn from_leaf_keys(leaf_keys: &[u32], depth: u32, full_depth: u32) -> Self {
        let mut nonempty_keys = vec![leaf_keys.to_vec()];
        for _ in 0..depth {
            let mut parents: Vec<u32> = nonempty_keys[nonempty_keys.len() - 1].iter().map(|key| key >> 3).collect();
            parents.dedup();
            nonempty_keys.push(parents);
        }
        nonempty_keys.reverse();
        let levels = (0..=depth)
            .into_par_iter()
            .map(|d| {
                let keys = match d.checked_sub(1) {
                    Some(parent_depth) if d > full_depth => child_keys(&nonempty_keys[parent_depth as usize]),
                    _ => full_keys(d),
                };
                let mut level = Level::new(keys, d < full_depth);
                level.set_nonempty_keys(&nonempty_keys[d as usize]);
                if (full_depth..depth).contains(&d) {
                    level.children = level.rows.iter().map(|&row| if row < 0 { -1 } else { 8 * row }).collect();
                }
                level
            })
            .collect();
        Self { full_depth, levels }
    }

    /// Builds the octree whose leaves of depth `d` have the strictly increasing keys `leaf_keys[d]`, none above the
    /// full depth.
    pub(crate) fn from_leaf_keys_by_depth(leaf_keys: &[&[u32]], full_depth: u32) -> Result<Self, OctreeError> {
        let depth = leaf_keys.len() as u32 - 1;
        // For each depth: nodes that are split because a node below them is non-empty, and all non-empty nodes.
        let mut split = vec![Vec::new(); leaf_keys.len()];
        let mut nonempty: Vec<Vec<u32>> = vec![Vec::new(); leaf_keys.len()];
        for d in (0..leaf_keys.len()).rev() {
            let leaves = leaf_keys[d];
            if let Some(index) = leaves.iter().position(|key| split[d].binary_search(key).is_ok()) {
                return Err(OctreeError::LeafKey { index, key: leaves[index], depth: d as u32 });
            }
            nonempty[d] = [&split[d][..], leaves].concat();
            nonempty[d].sort_unstable();
            if d > 0 {
                split[d - 1] = nonempty[d].iter().map(|key| key >> 3).collect();
                split[d - 1].dedup();
            }
        }
        let levels = (0..=depth).map(|d| {
            let keys = match d.checked_sub(1) {
                Some(above) if d > full_depth => child_keys(&split[above as usize]),
                _ => full_keys(d),
            };
            let mut level = Level::new(keys, d < full_depth);
            level.set_nonempty_keys(&nonempty[d as usize]);
            if d >= full_depth {
                let mut node = 0;
                for (rank, key) in (0..).zip(&split[d as usize]) {
                    while level.keys[node] != *key {
                        node += 1;
                    }
                    level.children[node] = 8 * rank;
                }
            }
            level
        });
        Ok(Self { full_depth, levels: levels.collect() })
    }

    /// Returns the depth of the finest level.
    pub fn depth(&self) -> u32 {
        self.levels.len() as u32 - 1
    }

    /// Returns the depth down to which every node exists.
    pub fn full_depth(&self) -> u32 {
        self.full_depth
    }

    /// Returns the levels, coarsest (the root alone) first.
    pub fn levels(&self) -> &[Level] {
        &self.levels
    }

    /// Iterates over the non-empty leaves, coarse ones first, in node order within a depth.
    pub fn leaf_nodes(&self) -> impl Iterator<Item = LeafNode> + '_ {
        self.levels.iter().zip(0..).flat_map(|(level, depth)| {
            let leaf = move |node: usize| {
                let row = usize::try_from(level.rows[node]).ok().filter(|_| level.children[node] < 0)?;
                Some(LeafNode { depth, node, row })
            };
            (0..level.len()).filter_map(leaf)
        })
    }

    /// Returns the shuffled key of a leaf.
    pub fn key(&self, leaf: LeafNode) -> u32 {
        self.levels[leaf.depth as usize].keys[leaf.node]
    }

    /// Wraps levels that fulfil the invariants of [`Octree`].
    pub(crate) fn from_valid_levels(levels: Vec<Level>, full_depth: u32) -> Self {
        Self { full_depth, levels }
    }

    /// Gives growth access to the levels.
    pub(crate) fn levels_mut(&mut self) -> &mut Vec<Level> {
        &mut self.levels
    }
}

impl Level {
    /// Creates empty nodes with these keys, all split or none.
    pub(crate) fn new(keys: Vec<u32>, split: bool) -> Self {
        let children = (0..keys.len() as i32).map(|node| if split { 8 * node } else { -1 }).collect();
        let rows = vec![-1; keys.len()];
        Self { keys, children, rows, nonempty: 0 }
    }

    /// Gives a row to each node whose key is in `nonempty_keys`, a sorted subset of the level's keys.
    fn set_nonempty_keys(&mut self, nonempty_keys: &[u32]) {
        let mut node = 0;
        for (row, &key) in nonempty_keys.iter().enumerate() {
            while self.keys[node] != key {
                node += 1;
            }
            self.rows[node] = row as i32;
        }
        self.nonempty = nonempty_keys.len();
    }

    /// Numbers the rows of the nodes that are labelled non-empty; one label per node.
    pub(crate) fn number_rows(&mut self, nonempty: impl Iterator<Item = bool>) {
        self.nonempty = 0;
        for (row, nonempty) in self.rows.iter_mut().zip(nonempty) {
            *row = if nonempty { self.nonempty as i32 } else { -1 };
            self.nonempty += usize::from(nonempty);
        }
    }

    /// Iterates over the keys of the non-empty nodes, in the order of the feature rows.
    pub fn row_keys(&self) -> impl Iterator<Item = u32> + '_ {
        self.keys.iter().zip(&self.rows).filter(|(_, row)| **row >= 0).map(|(key, _)| *key)
    }

    /// Returns the number of nodes.
    pub fn len(&self) -> usize {
        self.keys.len()
    }

    /// Returns whether the level has no nodes (below a level in which nothing is split).
    pub fn is_empty(&self) -> bool {
        self.keys.is_empty()
    }
}

/// Checks the depths of an octree, for callers that do expensive work before they build it.
///
/// # Errors
/// Depths that keys and indices cannot hold.
pub fn check_depths(depth: u32, full_depth: u32) -> Result<(), OctreeError> {
    if !(1..=MAX_DEPTH).contains(&depth) {
        return Err(OctreeError::Depth { depth });
    }
    if full_depth > depth.min(MAX_FULL_DEPTH) {
        return Err(OctreeError::FullDepth { full_depth, depth });
    }
    Ok(())
}

fn full_keys(depth: u32) -> Vec<u32> {
    (0..1 << (3 * depth)).collect()
}

fn child_keys(parent_keys: &[u32]) -> Vec<u32> {
    parent_keys.iter().flat_map(|key| (0..8).map(move |child| key << 3 | child)).collect()
}
