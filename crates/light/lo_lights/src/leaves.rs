//! Leaves of an octree with the surface that they expose to the room, and their adjacency.

use lo_cone::ConeTracer;
use lo_geometry::Vec3;
use lo_octree::LightOctree;

use crate::cap::luminance;
use crate::face::{exposed_normals, look_into_room, opacity_behind};
use crate::shape::LeafSurface;

/// A non-empty node that is not split.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Leaf {
    pub depth: u32,
    pub key: u32,
    pub row: usize,
    pub radiance: Vec3,
    /// Opacity of the leaf and of those behind it, mean over the faces of its surface.
    pub opacity: f32,
    pub surface: LeafSurface,
}

impl Leaf {
    pub fn luminance(&self) -> f32 {
        luminance(self.radiance)
    }

    /// Returns the area in m² of an opaque surface that emits as much.
    pub fn emitting_area_m2(&self) -> f32 {
        self.opacity * self.surface.area_m2
    }
}

/// All leaves, coarse ones first and in node order within a depth.
pub(crate) struct Leaves {
    pub all: Vec<Leaf>,
    /// `index[depth][node]`: number of the leaf, `u32::MAX` for other nodes.
    index: Vec<Vec<u32>>,
}

impl Leaves {
    pub fn of(light: &LightOctree, tracer: &ConeTracer) -> Self {
        let mut all = Vec::new();
        let mut index: Vec<Vec<u32>> = light.octree.levels().iter().map(|level| vec![u32::MAX; level.len()]).collect();
        for leaf in light.octree.leaf_nodes() {
            let (depth, key, radiance) = (leaf.depth, light.octree.key(leaf), light.radiance(leaf));
            index[depth as usize][leaf.node] = all.len() as u32;
            let surface = LeafSurface {
                centre_m: light.node_middle_m(depth, key),
                edge_m: light.cube.node_edge_m(depth),
                area_m2: 0.0,
                vector_area_m2: Vec3::ZERO,
                luminance: luminance(radiance),
            };
            all.push(Leaf { depth, key, row: leaf.row, radiance, opacity: 0.0, surface });
        }
        let mut leaves = Self { all, index };
        leaves.find_surfaces(light, tracer);
        leaves
    }

    /// Selects the faces that border on empty nodes and look into the room; if none look into the room, all that border
    /// on empty nodes.
    fn find_surfaces(&mut self, light: &LightOctree, tracer: &ConeTracer) {
        let mut faces: Vec<(usize, Vec3)> = Vec::new();
        for (i, leaf) in self.all.iter().enumerate() {
            faces.extend(exposed_normals(light, leaf.depth, leaf.surface.centre_m).map(|normal| (i, normal)));
        }
        let places = faces.iter().map(|&(i, normal)| {
            let LeafSurface { centre_m, edge_m, .. } = self.all[i].surface;
            (centre_m, edge_m, normal)
        });
        let look_inside = look_into_room(places, tracer);
        let mut axes = vec![Vec3::ZERO; self.all.len()];
        let mut opacities = vec![(0.0, 0.0); self.all.len()];
        for ((i, normal), looks_inside) in faces.into_iter().zip(look_inside) {
            if looks_inside {
                axes[i] += normal.abs();
                let Leaf { depth, surface, .. } = &mut self.all[i];
                opacities[i].0 += opacity_behind(light, *depth, surface.centre_m, normal);
                opacities[i].1 += 1.0;
                surface.vector_area_m2 += normal * surface.edge_m * surface.edge_m;
            }
        }
        // The faces of a slanted wall form a staircase whose area exceeds the wall's by up to √3. The norm over the
        // axes is exact for diagonal walls, too.
        for ((leaf, axes), (opacity, faces)) in self.all.iter_mut().zip(axes).zip(opacities) {
            leaf.surface.area_m2 = axes.length() * leaf.surface.edge_m * leaf.surface.edge_m;
            leaf.opacity = if faces > 0.0 { opacity / faces } else { 0.0 };
            leaf.surface.luminance *= leaf.opacity;
        }
    }

    /// Appends the numbers of the leaves adjacent to a leaf, including at corners.
    pub fn touching(&self, light: &LightOctree, leaf: usize, found: &mut Vec<usize>) {
        let Leaf { depth, key, .. } = self.all[leaf];
        let xyz = lo_octree::xyz_from_key(key);
        let side = 1i64 << depth;
        for offset in (0..27i64).filter(|offset| *offset != 13) {
            let moved =
                [xyz[0] as i64 + offset / 9 - 1, xyz[1] as i64 + offset / 3 % 3 - 1, xyz[2] as i64 + offset % 3 - 1];
            if moved.iter().all(|c| (0..side).contains(c)) {
                let key = lo_octree::key_from_xyz(moved.map(|c| c as u32));
                let (depth, node) = light.octree.deepest(depth, key);
                self.collect(light, (depth as usize, node), leaf, found);
            }
        }
    }

    fn collect(&self, light: &LightOctree, (depth, node): (usize, usize), of: usize, found: &mut Vec<usize>) {
        let first = light.octree.levels()[depth].children[node];
        if first >= 0 {
            (0..8).for_each(|child| self.collect(light, (depth + 1, first as usize + child), of, found));
            return;
        }
        let number = self.index[depth][node];
        if number != u32::MAX && number as usize != of && !found.contains(&(number as usize)) {
            let (a, b) = (&self.all[of].surface, &self.all[number as usize].surface);
            // Of the fine leaves in an adjacent node, those on the near side.
            if (a.centre_m - b.centre_m).abs().max_element() < 0.51 * (a.edge_m + b.edge_m) {
                found.push(number as usize);
            }
        }
    }
}
