//! Which faces of the occupied leaves the room's air touches.
//!
//! Air is what a flood from the camera reaches through face-neighbouring empty nodes. So a wall shows its inner side alone,
//! and the mesh holds no face that nobody in the room can see.
//!
//! Estimated rooms have holes of a few leaves in their walls (the shells of both test photos do). Therefore the flood
//! goes far through large empty nodes alone, and from these through small ones only as far as the next surfaces: what gets
//! through a hole shows a few faces around it, not the outside of the whole room.

use lo_geometry::Vec3;
use lo_octree::{LeafNode, LightOctree, Octree};

/// Opacity below which a node counts as air: a network leaves faint nodes, which nobody would call a surface.
const AIR_OPACITY: f32 = 0.01;

/// Depth of the smallest nodes through which the flood goes far: 1/32 of the cube, about 0.2 m. In a shallow octree it is four leaves.
const COARSE_DEPTH: u32 = 5;

/// The six face directions: −x, +x, −y, +y, −z, +z.
pub(crate) const FACES: [[i32; 3]; 6] = [[-1, 0, 0], [1, 0, 0], [0, -1, 0], [0, 1, 0], [0, 0, -1], [0, 0, 1]];

/// A node that is split no further and has radiance.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Leaf {
    /// Depth of the node.
    pub depth: u32,
    /// Index of the node in its level.
    pub node: usize,
    /// Row of its features in its level.
    pub row: usize,
    /// Integer coordinates among the nodes of its depth.
    pub xyz: [u32; 3],
    /// Centre in metres.
    pub centre_m: Vec3,
    /// Edge in metres.
    pub edge_m: f32,
    /// Linear RGB radiance and opacity.
    pub rgba: [f32; 4],
    /// Share of its points that the photo saw, in [0, 1].
    pub seen: f32,
    /// Share of its radiance that a panorama of the room gave, in [0, 1].
    pub panorama: f32,
    /// Bit `i`: air touches the face in direction [`FACES`]`[i]`. No bit for a leaf that is itself air.
    pub exposed: u8,
}

impl Leaf {
    /// As the octree knows it.
    pub fn leaf_node(&self) -> LeafNode {
        LeafNode { depth: self.depth, node: self.node, row: self.row }
    }

    /// Linear RGB radiance.
    pub fn radiance(&self) -> [f32; 3] {
        [self.rgba[0], self.rgba[1], self.rgba[2]]
    }

    /// Luminance of the radiance, Rec. 709.
    pub fn luminance(&self) -> f32 {
        lo_imaging::luminance(self.radiance())
    }

    /// Sum of the exposed faces' outward normals times their areas, in m².
    pub fn vector_area_m2(&self) -> Vec3 {
        let sum: Vec3 = self.exposed_faces().map(|face| Vec3::from(FACES[face].map(|c| c as f32))).sum();
        sum * (self.edge_m * self.edge_m)
    }

    /// Area of the smooth surface that the exposed faces stand for, in m².
    ///
    /// The faces of a slanted wall are a staircase whose area exceeds the wall's by up to √3. The Euclidean norm over the axes
    /// is exact for axis-aligned and for diagonal surfaces, and counts both sides of a plate.
    pub fn surface_area_m2(&self) -> f32 {
        let mut axes = Vec3::ZERO;
        for face in self.exposed_faces() {
            axes[face / 2] += 1.0;
        }
        axes.length() * self.edge_m * self.edge_m
    }

    /// Indices into [`FACES`] of the exposed faces.
    pub fn exposed_faces(&self) -> impl Iterator<Item = usize> + use<> {
        let exposed = self.exposed;
        (0..FACES.len()).filter(move |face| exposed >> face & 1 == 1)
    }
}

/// All leaves of the octree with radiance, coarse levels first and in node order within a level.
///
/// `panorama_share` is that of the rows, by depth, where there is one.
pub(crate) fn leaves(light: &LightOctree, panorama_share: Option<&[Vec<u8>]>) -> Vec<Leaf> {
    let coordinates = coordinates(&light.octree);
    let air = FreeSpace::flood(light, &coordinates);
    let mut leaves = Vec::new();
    for (depth, level) in light.octree.levels().iter().enumerate() {
        let depth = depth as u32;
        let edge_m = light.cube.node_edge_m(depth);
        for (node, (&row, &children)) in level.rows.iter().zip(&level.children).enumerate() {
            if row < 0 || children >= 0 {
                continue;
            }
            let (row, xyz) = (row as usize, coordinates[depth as usize][node]);
            leaves.push(Leaf {
                depth,
                node,
                row,
                xyz,
                centre_m: light.cube.origin_m + (Vec3::from(xyz.map(|c| c as f32)) + 0.5) * edge_m,
                edge_m,
                rgba: light.rgba[depth as usize][row],
                seen: f32::from(light.seen[depth as usize][row]) / 255.0,
                panorama: panorama_share.map_or(0.0, |share| f32::from(share[depth as usize][row]) / 255.0),
                exposed: if air.is_air(depth, node) { 0 } else { air.exposed(depth, xyz) },
            });
        }
    }
    leaves
}

/// Integer coordinates of every node, per level.
fn coordinates(octree: &Octree) -> Vec<Vec<[u32; 3]>> {
    octree.levels().iter().map(|level| level.keys.iter().map(|&key| lo_octree::xyz_from_key(key)).collect()).collect()
}

/// What the flood from the camera reached.
struct FreeSpace<'a> {
    light: &'a LightOctree,
    /// `reached[d][node]`: air that the flood came to.
    reached: Vec<Vec<bool>>,
    /// Whether what lies outside of the cube counts as reached.
    outside: bool,
}

impl<'a> FreeSpace<'a> {
    fn flood(light: &'a LightOctree, coordinates: &[Vec<[u32; 3]>]) -> Self {
        let reached = light.octree.levels().iter().map(|level| vec![false; level.keys.len()]).collect();
        let mut air = Self { light, reached, outside: false };
        let Some(start) = air.camera_node() else {
            // A camera outside of the cube or inside of matter: nothing tells the room's air from the rest.
            air.outside = true;
            for depth in 0..light.octree.levels().len() {
                for node in 0..air.reached[depth].len() {
                    air.reached[depth][node] = air.is_air(depth as u32, node);
                }
            }
            return air;
        };
        // First through the large empty nodes, as far as they reach.
        let depth = light.octree.depth();
        let coarse = depth.saturating_sub(2).min(COARSE_DEPTH).max(light.octree.full_depth()).max(start.0);
        air.reached[start.0 as usize][start.1] = true;
        let mut reached = vec![start];
        let mut next = 0;
        while let Some(&node) = reached.get(next) {
            air.spread(node, coordinates, |depth| depth <= coarse, &mut reached);
            next += 1;
        }
        // Then through the small ones between these and the surfaces, layer by layer.
        let mut front = reached;
        for _ in 0..2 << (depth - coarse) {
            let mut layer = Vec::new();
            for &node in &front {
                air.spread(node, coordinates, |depth| depth > coarse, &mut layer);
            }
            front = layer;
        }
        air
    }

    /// Marks the air beside a node, at depths that `passes` allows, and appends what was not reached before.
    fn spread(
        &mut self,
        (depth, node): (u32, usize),
        coordinates: &[Vec<[u32; 3]>],
        passes: impl Fn(u32) -> bool,
        found: &mut Vec<(u32, usize)>,
    ) {
        let mut touching = Vec::new();
        for face in 0..FACES.len() {
            self.touching(depth, coordinates[depth as usize][node], face, &mut touching);
        }
        for (depth, node) in touching {
            if passes(depth) && self.is_air(depth, node) && !self.reached[depth as usize][node] {
                self.reached[depth as usize][node] = true;
                found.push((depth, node));
            }
        }
    }

    /// The unsplit node around the camera, if it is air.
    fn camera_node(&self) -> Option<(u32, usize)> {
        let (depth, node) = self.light.locate(Vec3::ZERO, self.light.octree.depth())?;
        self.is_air(depth, node).then_some((depth, node))
    }

    /// Whether an unsplit node is empty or too faint to be a surface.
    fn is_air(&self, depth: u32, node: usize) -> bool {
        let level = &self.light.octree.levels()[depth as usize];
        let row = level.rows[node];
        level.children[node] < 0 && (row < 0 || self.light.rgba[depth as usize][row as usize][3] < AIR_OPACITY)
    }

    /// Bits of the faces of the node at `xyz` that reached air touches.
    fn exposed(&self, depth: u32, xyz: [u32; 3]) -> u8 {
        let mut touching = Vec::new();
        let mut bits = 0;
        for face in 0..FACES.len() {
            touching.clear();
            let inside = self.touching(depth, xyz, face, &mut touching);
            let air = if inside { touching.iter().any(|&(d, n)| self.reached[d as usize][n]) } else { self.outside };
            bits |= u8::from(air) << face;
        }
        bits
    }

    /// Appends the unsplit nodes that touch a face of the node at `xyz`; `false` where the face lies on the cube's boundary.
    fn touching(&self, depth: u32, xyz: [u32; 3], face: usize, nodes: &mut Vec<(u32, usize)>) -> bool {
        let edge_m = self.light.cube.node_edge_m(depth);
        let mut beyond = self.light.cube.origin_m;
        for axis in 0..3 {
            let moved = i64::from(xyz[axis]) + i64::from(FACES[face][axis]);
            if moved < 0 || moved >= 1 << depth {
                return false;
            }
            beyond[axis] += (moved as f32 + 0.5) * edge_m;
        }
        let Some((found, node)) = self.light.locate(beyond, depth) else { return false };
        // The neighbour's side that looks back: the lower half of it when we look in the positive direction.
        let upper_half = FACES[face][face / 2] < 0;
        self.collect(found, node, face / 2, upper_half, nodes);
        true
    }

    /// Appends the unsplit descendants of a node that touch one of its sides.
    fn collect(&self, depth: u32, node: usize, axis: usize, upper_half: bool, nodes: &mut Vec<(u32, usize)>) {
        let children = self.light.octree.levels()[depth as usize].children[node];
        if children < 0 {
            nodes.push((depth, node));
            return;
        }
        // Child `4·x + 2·y + z`.
        for child in (0..8).filter(|child| (child >> (2 - axis) & 1 == 1) == upper_half) {
            self.collect(depth + 1, children as usize + child, axis, upper_half, nodes);
        }
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use lo_geometry::Cube;

    use super::*;
    use crate::test_scene::{box_room, light_of};

    #[test]
    fn a_closed_room_shows_its_inside_alone() {
        let leaves = leaves(&box_room().light, None);
        // The shell of 8³ cells, and 6 × 6 inner faces on each of its six sides.
        assert_eq!(leaves.len(), 8usize.pow(3) - 6usize.pow(3));
        assert_eq!(leaves.iter().map(|leaf| leaf.exposed.count_ones()).sum::<u32>(), 6 * 36);
        for leaf in leaves.iter().filter(|leaf| leaf.exposed != 0) {
            assert!(leaf.vector_area_m2().dot(-leaf.centre_m) > 0.0, "{leaf:?} looks into the room");
            assert_eq!(leaf.surface_area_m2(), 0.25);
        }
    }

    #[test]
    fn a_hole_in_the_wall_does_not_show_the_outside() {
        // A shell three cells inside of a cube of 64³, with a hole of 3 × 3 cells in its −z wall.
        let shell = |xyz: &[u32; 3]| {
            let inside = xyz.iter().all(|c| (3..61).contains(c)) && xyz.iter().any(|c| *c == 3 || *c == 60);
            inside && !(xyz[2] == 3 && (30..33).contains(&xyz[0]) && (30..33).contains(&xyz[1]))
        };
        let cells = (0..64u32.pow(3)).map(|i| [i / 4096, i / 64 % 64, i % 64]).filter(shell);
        let cells: Vec<_> = cells.map(|xyz| (xyz, [0.5, 0.5, 0.5, 1.0])).collect();
        let leaves = leaves(&light_of(&cells, Cube::centred(Vec3::ZERO, 4.0), 6), None);
        let faces = |inward: bool| -> u32 {
            let is_inward = |leaf: &Leaf, face: usize| {
                (Vec3::from(FACES[face].map(|c| c as f32)).dot(-leaf.centre_m) > 0.0) == inward
            };
            leaves.iter().map(|leaf| leaf.exposed_faces().filter(|&face| is_inward(leaf, face)).count() as u32).sum()
        };
        // All inner faces but the hole's nine; outside no more than the few layers of the flood can touch.
        let inner = 6 * 56 * 56 - 9;
        assert!((inner..=inner + 12).contains(&faces(true)), "{}", faces(true));
        assert!(faces(false) < 500, "{}", faces(false));
    }

    #[test]
    fn a_camera_in_matter_or_outside_shows_all_faces() {
        let cell = |xyz| (xyz, [0.5, 0.5, 0.5, 1.0]);
        for origin in [Vec3::splat(5.0), Vec3::splat(-0.25)] {
            let light = light_of(&[cell([0, 0, 0]), cell([1, 0, 0])], Cube { origin_m: origin, edge_m: 2.0 }, 2);
            let leaves = leaves(&light, None);
            assert_eq!(leaves.iter().map(|leaf| leaf.exposed.count_ones()).sum::<u32>(), 10);
        }
    }

    #[test]
    fn faint_nodes_are_air() {
        let cube = Cube { origin_m: Vec3::splat(-1.0), edge_m: 2.0 };
        let light = light_of(&[([1, 1, 1], [0.5, 0.5, 0.5, 0.005]), ([0, 1, 1], [0.5, 0.5, 0.5, 0.9])], cube, 1);
        let leaves = leaves(&light, None);
        // Both are leaves with radiance, but one alone has faces: towards its three neighbours in the cube.
        let exposed: Vec<u32> = leaves.iter().map(|leaf| leaf.exposed.count_ones()).collect();
        assert_eq!(exposed, [3, 0]);
    }

    #[test]
    fn coarse_and_fine_nodes_meet() {
        // Eight octants, the first (low corner) coarse and solid, the others coarse and air, but the +x one is split and its
        // four children on the low x side are solid.
        let cube = Cube { origin_m: Vec3::new(-3.0, -3.0, -3.0), edge_m: 4.0 };
        let solid = [0.5, 0.5, 0.5, 1.0];
        let mut light = light_of(&[([0, 0, 0], solid), ([1, 0, 0], solid)], cube, 1);
        light.octree.grow(&[false, false, false, false, true, false, false, false]).unwrap();
        light.octree.set_nonempty(&[true, true, true, true, false, false, false, false]).unwrap();
        light.rgba.push(vec![[0.25, 0.25, 0.25, 1.0]; 4]);
        light.seen.push(vec![255; 4]);
        let leaves = leaves(&light, None);
        assert_eq!(leaves.iter().map(|leaf| leaf.depth).collect::<Vec<_>>(), [1, 2, 2, 2, 2]);
        // Coarse: +y and +z; its +x face is covered by the fine ones, and the boundary shows nothing.
        assert_eq!(leaves[0].exposed, 0b10_10_00);
        // Fine: each has +x; the upper ones +y, the front ones +z.
        let fine: Vec<u8> = leaves[1..].iter().map(|leaf| leaf.exposed).collect();
        assert_eq!(fine, [0b00_00_10, 0b10_00_10, 0b00_10_10, 0b10_10_10]);
        assert_eq!(leaves[0].edge_m, 2.0);
        assert_eq!(leaves[4].centre_m, Vec3::new(-0.5, -1.5, -1.5));
    }
}
