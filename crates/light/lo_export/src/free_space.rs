//! Flood fill of free space, to find the visible faces of occupied leaves.
//!
//! Free space is what a flood fill from the camera reaches through face-adjacent empty nodes. So a wall has only its
//! inner side, and the mesh has no face that is invisible from the room.
//!
//! Walls of estimated rooms have holes of a few leaves. Therefore the flood spreads far only through large empty
//! nodes, and from these through small ones only to the next surfaces. Through a hole it reaches a few faces around
//! it, not the outside of the whole room.

use lo_geometry::Vec3;
use lo_octree::{LeafNode, LightOctree, Octree};

/// Opacity below which a node counts as free: networks leave faint nodes that are not surfaces.
const AIR_OPACITY: f32 = 0.01;

/// Depth of the smallest nodes through which the flood spreads far: 1/32 of the cube, about 0.2 m. In a shallow
/// octree it is four leaves.
const COARSE_DEPTH: u32 = 5;

/// The six face directions: −x, +x, −y, +y, −z, +z.
pub(crate) const FACES: [[i32; 3]; 6] = [[-1, 0, 0], [1, 0, 0], [0, -1, 0], [0, 1, 0], [0, 0, -1], [0, 0, 1]];

/// A leaf of the octree with radiance.
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
    /// Share of its points that the photo observed, in [0, 1].
    pub seen: f32,
    /// Share of its radiance that comes from a panorama, in [0, 1].
    pub panorama: f32,
    /// Bit `i`: the face in direction [`FACES`]`[i]` is exposed to free space. No bits for a leaf that counts as free
    /// itself.
    pub exposed: u8,
}

impl Leaf {
    /// Returns the leaf's node in the octree.
    pub fn leaf_node(&self) -> LeafNode {
        LeafNode { depth: self.depth, node: self.node, row: self.row }
    }

    /// Returns the linear RGB radiance.
    pub fn radiance(&self) -> [f32; 3] {
        [self.rgba[0], self.rgba[1], self.rgba[2]]
    }

    /// Returns the luminance of the radiance, Rec. 709.
    pub fn luminance(&self) -> f32 {
        lo_imaging::luminance(self.radiance())
    }

    /// Returns the sum of the exposed faces' outward normals times their areas, in m².
    pub fn vector_area_m2(&self) -> Vec3 {
        let sum: Vec3 = self.exposed_faces().map(|face| Vec3::from(FACES[face].map(|c| c as f32))).sum();
        sum * (self.edge_m * self.edge_m)
    }

    /// Returns the area of the smooth surface that the exposed faces approximate, in m².
    ///
    /// The faces of a slanted wall form a staircase, whose area exceeds the wall's by up to √3. The Euclidean norm
    /// over the axes is exact for axis-aligned and for diagonal surfaces, and counts both sides of a plate.
    pub fn surface_area_m2(&self) -> f32 {
        let mut axes = Vec3::ZERO;
        for face in self.exposed_faces() {
            axes[face / 2] += 1.0;
        }
        axes.length() * self.edge_m * self.edge_m
    }

    /// Returns the indices into [`FACES`] of the exposed faces.
    pub fn exposed_faces(&self) -> impl Iterator<Item = usize> + use<> {
        let exposed = self.exposed;
        (0..FACES.len()).filter(move |face| exposed >> face & 1 == 1)
    }
}

/// Returns all leaves of the octree with radiance, coarse levels first and in node order within a level.
///
/// `panorama_share` has the rows' share by depth, if there is a panorama.
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

/// Returns the integer coordinates of every node, per level.
fn coordinates(octree: &Octree) -> Vec<Vec<[u32; 3]>> {
    octree.levels().iter().map(|level| level.keys.iter().map(|&key| lo_octree::xyz_from_key(key)).collect()).collect()
}

/// Result of the flood fill from the camera.
struct FreeSpace<'a> {
    light: &'a LightOctree,
    /// `reached[d][node]`: free nodes that the flood reached.
    reached: Vec<Vec<bool>>,
    /// Whether the outside of the cube counts as reached.
    outside: bool,
}

impl<'a> FreeSpace<'a> {
    fn flood(light: &'a LightOctree, coordinates: &[Vec<[u32; 3]>]) -> Self {
        let reached = light.octree.levels().iter().map(|level| vec![false; level.keys.len()]).collect();
        let mut air = Self { light, reached, outside: false };
        let Some(start) = air.camera_node() else {
            // With the camera outside of the cube or inside of matter, all free nodes count.
            air.outside = true;
            for depth in 0..light.octree.levels().len() {
                for node in 0..air.reached[depth].len() {
                    air.reached[depth][node] = air.is_air(depth as u32, node);
                }
            }
            return air;
        };
        // First spread through the large empty nodes.
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

    /// Marks the free nodes next to a node, at depths that `passes` accepts, and appends the newly reached ones.
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

    /// Returns the leaf that contains the camera, if it is free.
    fn camera_node(&self) -> Option<(u32, usize)> {
        let (depth, node) = self.light.locate(Vec3::ZERO, self.light.octree.depth())?;
        self.is_air(depth, node).then_some((depth, node))
    }

    /// Returns whether a leaf is empty or too faint to be a surface.
    fn is_air(&self, depth: u32, node: usize) -> bool {
        let level = &self.light.octree.levels()[depth as usize];
        let row = level.rows[node];
        level.children[node] < 0 && (row < 0 || self.light.rgba[depth as usize][row as usize][3] < AIR_OPACITY)
    }

    /// Returns bits of the faces of the node at `xyz` that touch reached nodes.
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

    /// Appends the leaves that touch a face of the node at `xyz`. Returns `false` if the face is on the cube's
    /// boundary.
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
        // The neighbour's opposite side: its lower half for the positive direction.
        let upper_half = FACES[face][face / 2] < 0;
        self.collect(found, node, face / 2, upper_half, nodes);
        true
    }

    /// Appends the leaves below a node that touch one of its sides.
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
        // All inner faces except the hole's nine; outside only those within reach of the flood's few layers.
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
        // Both are leaves with radiance, but only one has faces: towards its three neighbours in the cube.
        let exposed: Vec<u32> = leaves.iter().map(|leaf| leaf.exposed.count_ones()).collect();
        assert_eq!(exposed, [3, 0]);
    }

    #[test]
    fn coarse_and_fine_nodes_meet() {
        // Eight octants: the first (low corner) is coarse and solid, the others are coarse and free, except that the
        // +x one is split and its four children on the low x side are solid.
        let cube = Cube { origin_m: Vec3::new(-3.0, -3.0, -3.0), edge_m: 4.0 };
        let solid = [0.5, 0.5, 0.5, 1.0];
        let mut light = light_of(&[([0, 0, 0], solid), ([1, 0, 0], solid)], cube, 1);
        light.octree.grow(&[false, false, false, false, true, false, false, false]).unwrap();
        light.octree.set_nonempty(&[true, true, true, true, false, false, false, false]).unwrap();
        light.rgba.push(vec![[0.25, 0.25, 0.25, 1.0]; 4]);
        light.seen.push(vec![255; 4]);
        let leaves = leaves(&light, None);
        assert_eq!(leaves.iter().map(|leaf| leaf.depth).collect::<Vec<_>>(), [1, 2, 2, 2, 2]);
        // Coarse: +y and +z. Its +x face is covered by the fine ones, and the boundary has no faces.
        assert_eq!(leaves[0].exposed, 0b10_10_00);
        // Fine: each has +x; the upper ones +y, the front ones +z.
        let fine: Vec<u8> = leaves[1..].iter().map(|leaf| leaf.exposed).collect();
        assert_eq!(fine, [0b00_00_10, 0b10_00_10, 0b00_10_10, 0b10_10_10]);
        assert_eq!(leaves[0].edge_m, 2.0);
        assert_eq!(leaves[4].centre_m, Vec3::new(-0.5, -1.5, -1.5));
    }
}
