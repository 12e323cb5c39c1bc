/// The structure of a sparse voxel octree without features.
///
/// Full down to `full_depth`, sparse below. Nodes of one depth lie in shuffled-key (Morton) order, the eight children of a
/// split node next to each other. A node is *non-empty* when it has a feature row; rows of one depth are in node order.
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
    /// Index of the first of its eight children in the next level, or −1 where the node is not split.
    pub children: Vec<i32>,
    /// Row of its features in this level, or −1 where the node is empty.
    pub rows: Vec<i32>,
    /// Number of non-empty nodes.
    pub nonempty: usize,
}

impl Octree {
    /// Depth of the finest level.
    pub fn depth(&self) -> u32 {
        self.levels.len() as u32 - 1
    }

    /// Depth down to which every node exists.
    pub fn full_depth(&self) -> u32 {
        self.full_depth
    }

    /// The levels, coarsest (the root alone) first.
    pub fn levels(&self) -> &[Level] {
        &self.levels
    }
}
