use geometry::Vec3;

use crate::{LightOctree, Octree, leaves::leaf_key};

impl Octree {
    /// Index in level `depth` of the node with shuffled key `key`, if there is one.
    pub fn find(&self, depth: u32, key: u32) -> Option<usize> {
        if depth > self.depth() || key >> (3 * depth) != 0 {
            return None;
        }
        let (found, node) = self.deepest(depth, key);
        (found == depth).then_some(node)
    }

    /// Depth and index of the node with shuffled key `key` at `depth` (at most the octree's), or of its deepest ancestor.
    fn deepest(&self, depth: u32, key: u32) -> (u32, usize) {
        // In a full level the key is the index.
        let mut at = depth.min(self.full_depth());
        let mut node = (key >> (3 * (depth - at))) as usize;
        while at < depth {
            let first_child = self.levels()[at as usize].children[node];
            if first_child < 0 {
                break;
            }
            at += 1;
            node = first_child as usize + (key >> (3 * (depth - at)) & 7) as usize;
        }
        (at, node)
    }
}

impl LightOctree {
    /// Depth and index of the deepest node at most at `max_depth` that contains a point; `None` outside of the cube.
    pub fn locate(&self, point: Vec3, max_depth: u32) -> Option<(u32, usize)> {
        let depth = max_depth.min(self.octree.depth());
        self.cube.contains(point).then(|| self.octree.deepest(depth, leaf_key(point, self.cube, depth)))
    }

    /// Depth and row of every leaf: non-empty nodes that are not split, the coarse ones first.
    pub fn leaves(&self) -> impl Iterator<Item = (usize, usize)> + '_ {
        self.octree.levels().iter().enumerate().flat_map(|(depth, level)| {
            let leaves = level.rows.iter().zip(&level.children).filter(|(row, child)| **row >= 0 && **child < 0);
            leaves.map(move |(&row, _)| (depth, row as usize))
        })
    }

    /// RGBα of a node; `None` for an empty one.
    pub fn node_rgba(&self, depth: u32, node: usize) -> Option<[f32; 4]> {
        let row = usize::try_from(self.octree.levels()[depth as usize].rows[node]).ok()?;
        Some(self.rgba[depth as usize][row])
    }
}
