//! Leaves of an octree while a panorama is applied to them.

use std::collections::HashMap;

use lo_geometry::Vec3;
use lo_octree::{LightOctree, MAX_ALPHA};
use lo_scene::ObservedPhoto;

/// Depth and shuffled key.
pub(super) type NodeKey = (u32, u32);

/// Leaves of all depths.
pub(super) struct LeafSet {
    pub leaves: Vec<Leaf>,
    /// Least depth of leaves added at the cube's side.
    pub side_depth: u32,
}

#[derive(Clone, Copy, Debug)]
/// A leaf with its completed features and the panorama's light.
pub(super) struct Leaf {
    pub depth: u32,
    pub key: u32,
    /// Features before the panorama was applied.
    pub rgba: [f32; 4],
    pub seen: u8,
    pub confidence: u8,
    pub lobe: [f32; 3],
    /// Whether the photo does not determine its light.
    pub open: bool,
    /// Whether it closes a region that was empty or only half closed: at the cube's side, or at a lamp.
    pub closing: bool,
    /// Light of the panorama, without that of lamps.
    pub light: Option<[f32; 3]>,
    /// Light of lamps above that.
    pub lamp: [f32; 3],
}

impl LeafSet {
    /// Collects the leaves of an octree, with `confidence` by depth and row if given. Leaves are open if the photo did
    /// not observe them, or if all their pixels in `photo` are clipped.
    pub fn new(light: &LightOctree, confidence: Option<&Vec<Vec<u8>>>, photo: &ObservedPhoto) -> Self {
        let certain = certain(light, photo);
        let levels = light.octree.levels().iter().zip(0..);
        let leaves = levels.flat_map(|(level, depth)| {
            let nodes = (0..level.len()).filter(|&node| level.rows[node] >= 0 && level.children[node] < 0);
            let certain = &certain;
            nodes.map(move |node| {
                let (d, row) = (depth as usize, level.rows[node] as usize);
                let seen = light.seen[d][row];
                Leaf {
                    depth,
                    key: level.keys[node],
                    rgba: light.rgba[d][row],
                    seen,
                    confidence: confidence.map_or(0, |confidence| confidence[d][row]),
                    lobe: light.lobes.as_ref().map_or([0.0; 3], |lobes| lobes[d][row]),
                    open: seen == 0 || certain.get(&(depth, row)) == Some(&false),
                    closing: false,
                    light: None,
                    lamp: [0.0; 3],
                }
            })
        });
        let side_depth = light.octree.depth().saturating_sub(1).max(light.octree.full_depth());
        Self { leaves: leaves.collect(), side_depth }
    }

    /// Returns the leaf of each row of an octree of these leaves, by depth; `u32::MAX` for rows above the leaves.
    pub fn indices(&self, topology: &LightOctree) -> Vec<Vec<u32>> {
        let by_depth = self.by_depth(topology.octree.depth());
        let levels = topology.octree.levels().iter().zip(by_depth);
        let of_level = levels.map(|(level, leaves)| {
            let mut leaves = leaves.into_iter();
            let rows = (0..level.len()).filter(|&node| level.rows[node] >= 0);
            rows.map(|node| if level.children[node] < 0 { leaves.next().unwrap_or(u32::MAX) } else { u32::MAX })
                .collect()
        });
        of_level.collect()
    }

    /// Returns the leaves of each depth down to `depth`, in the order of their keys.
    pub fn by_depth(&self, depth: u32) -> Vec<Vec<u32>> {
        let mut by_depth = vec![Vec::new(); depth as usize + 1];
        for (index, leaf) in (0..).zip(&self.leaves) {
            by_depth[leaf.depth as usize].push(index);
        }
        for leaves in &mut by_depth {
            leaves.sort_unstable_by_key(|&index: &u32| self.leaves[index as usize].key);
        }
        by_depth
    }

    /// Adds opaque leaves in empty nodes.
    pub fn add_sides(&mut self, sides: &[NodeKey]) {
        let leaf = |&(depth, key): &NodeKey| Leaf {
            depth,
            key,
            rgba: [0.0, 0.0, 0.0, MAX_ALPHA],
            seen: 0,
            confidence: 0,
            lobe: [0.0; 3],
            open: true,
            closing: true,
            light: None,
            lamp: [0.0; 3],
        };
        self.leaves.extend(sides.iter().map(leaf));
    }
}

impl Leaf {
    /// Returns the features with the panorama's light, if any.
    pub fn final_rgba(&self) -> [f32; 4] {
        let lit = |[r, g, b]: [f32; 3]| [r + self.lamp[0], g + self.lamp[1], b + self.lamp[2], self.rgba[3]];
        self.light.map_or(self.rgba, lit)
    }
}

/// Returns, for the depth and row of each leaf that contains pixels with depth, whether any of these pixels is
/// unclipped.
fn certain(light: &LightOctree, photo: &ObservedPhoto) -> HashMap<(u32, usize), bool> {
    let (clipped, clean) = (photo.clean.clipped(), &photo.clean);
    let mut certain = HashMap::new();
    let pixels = (0..clean.depth_m.height()).flat_map(|y| (0..clean.depth_m.width()).map(move |x| (x, y)));
    for (x, y) in pixels {
        let at = light.cube.pulled_inside(clean.point(x, y).unwrap_or(Vec3::NAN));
        let Some((depth, node)) = light.locate(at, light.octree.depth()) else { continue };
        if let Ok(row) = usize::try_from(light.octree.levels()[depth as usize].rows[node]) {
            *certain.entry((depth, row)).or_insert(false) |= !clipped[(x, y)];
        }
    }
    certain
}
