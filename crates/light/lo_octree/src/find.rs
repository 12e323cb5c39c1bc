use lo_geometry::{Cube, Vec3};

use crate::{LightOctree, Octree, leaves::leaf_key, xyz_from_key};

impl Octree {
    /// Returns the index in level `depth` of the node with shuffled key `key`, if it exists.
    pub fn find(&self, depth: u32, key: u32) -> Option<usize> {
        if depth > self.depth() || key >> (3 * depth) != 0 {
            return None;
        }
        let (found, node) = self.deepest(depth, key);
        (found == depth).then_some(node)
    }

    /// Returns depth and index of the node with shuffled key `key` at `depth`, or of its deepest existing ancestor.
    /// `depth` is at most the octree's; `key` is a key of that depth.
    pub fn deepest(&self, depth: u32, key: u32) -> (u32, usize) {
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

/// Returns the centre, in metres, of the node of `depth` with this shuffled key in a cube.
pub fn node_middle_m(cube: Cube, depth: u32, key: u32) -> Vec3 {
    cube.world_from_unit((Vec3::from(xyz_from_key(key).map(|i| i as f32)) + 0.5) / (1u32 << depth) as f32)
}

impl LightOctree {
    /// Returns depth and index of the deepest node, down to `max_depth`, that contains a point; `None` outside the
    /// cube.
    pub fn locate(&self, point: Vec3, max_depth: u32) -> Option<(u32, usize)> {
        let depth = max_depth.min(self.octree.depth());
        self.cube.contains(point).then(|| self.octree.deepest(depth, leaf_key(point, self.cube, depth)))
    }

    /// Iterates over depth and row of every leaf (non-empty nodes that are not split), coarse ones first.
    pub fn leaves(&self) -> impl Iterator<Item = (usize, usize)> + '_ {
        self.octree.levels().iter().enumerate().flat_map(|(depth, level)| {
            let leaves = level.rows.iter().zip(&level.children).filter(|(row, child)| **row >= 0 && **child < 0);
            leaves.map(move |(&row, _)| (depth, row as usize))
        })
    }

    /// Returns the centre, in metres, of the node of `depth` with this shuffled key.
    pub fn node_middle_m(&self, depth: u32, key: u32) -> Vec3 {
        node_middle_m(self.cube, depth, key)
    }

    /// Returns the feature row of the node of `depth` with this shuffled key; `None` where it does not exist or is
    /// empty.
    pub fn row(&self, depth: u32, key: u32) -> Option<usize> {
        let node = self.octree.find(depth, key)?;
        usize::try_from(self.octree.levels()[depth as usize].rows[node]).ok()
    }

    /// Returns the RGBα of a node; `None` for an empty one.
    pub fn node_rgba(&self, depth: u32, node: usize) -> Option<[f32; 4]> {
        let row = usize::try_from(self.octree.levels()[depth as usize].rows[node]).ok()?;
        Some(self.rgba[depth as usize][row])
    }
}
