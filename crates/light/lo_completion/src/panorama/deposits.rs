//! Deposits of a panorama's light on the leaves that its rays hit.

use std::ops::ControlFlow;

use lo_geometry::{Ray, Vec3};
use lo_octree::{LightOctree, key_from_xyz};
use rayon::prelude::*;

use super::accumulator::{Deposit, LeafAccumulator};
use super::leaves::{LeafSet, NodeKey};
use super::march::{Crossing, march};
use super::rays::Rays;

/// Least distance of surfaces from the panorama's position, in metres; nearer ones are errors of the geometry.
const CLEARANCE_M: f32 = 0.15;

/// Distance behind the leaf that closes the view, in edges of that leaf, within which leaves get the same light, with
/// at least this weight: cones blend between leaves.
const BACKING: f32 = 2.0;
const BACKING_WEIGHT: f32 = 0.02;

/// That distance for lamps on leaves that were half open. It is one leaf, since otherwise inferred surfaces over a
/// wide range of depths would emit light.
const LAMP_BACKING: f32 = 1.05;

/// Transmittance below which the view is closed, and transmittance below which the ray ends.
const CLOSED: f32 = 0.5;
const MIN_TRANSMITTANCE: f32 = 1e-3;

/// Least share of a ray that must end on a leaf further behind for it to get light.
const MIN_SHARE: f32 = 0.05;

/// Transmittance out of the cube above which a leaf is added at the cube's side.
const OPEN: f32 = 0.5;

/// The deposits of all rays.
pub(super) struct RayDeposits {
    /// Sums per leaf.
    pub sums: Vec<LeafAccumulator>,
    /// Depths and keys of the empty nodes at the cube's side through which rays leave.
    pub sides: Vec<NodeKey>,
}

impl LeafSet {
    /// Casts the rays from `position_m` through `topology`, an octree of these leaves.
    pub fn cast_rays(&self, topology: &LightOctree, rays: &Rays, position_m: Vec3) -> RayDeposits {
        let indices = self.indices(topology);
        let row = |row: usize| {
            let (mut deposits, mut sides) = (Vec::new(), Vec::new());
            let shown =
                (0u32..).zip(rays.directions(row)).filter(|(column, _)| !rays.light(*column as usize, row).missing);
            for (column, direction) in shown {
                let ray = Ray { origin: position_m, direction };
                sides.extend(
                    self.cast(topology, &indices, &ray, |deposit| deposits.push(Deposit { column, ..deposit })),
                );
            }
            (deposits, sides)
        };
        let rows: Vec<(Vec<Deposit>, Vec<NodeKey>)> = (0..rays.rows()).into_par_iter().map(row).collect();
        // Sums in the order of the rays, for any number of threads.
        let mut sums = vec![LeafAccumulator::default(); self.leaves.len()];
        let mut sides = Vec::new();
        for (row, (deposits, open)) in rows.into_iter().enumerate() {
            let solid_angle = rays.solid_angle_sr(row);
            for deposit in deposits {
                sums[deposit.leaf as usize].add(rays.light(deposit.column as usize, row), &deposit, solid_angle);
            }
            sides.extend(open);
        }
        sides.sort_unstable();
        sides.dedup();
        RayDeposits { sums, sides }
    }

    /// Casts one ray: calls `deposit_on` for each open leaf on which a part ends, and returns the empty node through
    /// which most of the ray leaves the cube.
    fn cast(
        &self,
        topology: &LightOctree,
        indices: &[Vec<u32>],
        ray: &Ray,
        mut deposit_on: impl FnMut(Deposit),
    ) -> Option<NodeKey> {
        let (mut left, mut closed_to_m) = (1.0f32, f32::INFINITY);
        // For the leaf that closes the view: the share that reached it, its edge, the end of its backing, and whether
        // it is solid.
        let (mut came, mut closing_m, mut lamp_to_m, mut solid) = (0.0, 0.0, 0.0, false);
        let mut last = None;
        march(topology, ray, |crossing| {
            last = Some(crossing);
            let Some(row) = crossing.row.filter(|_| crossing.leave_m > CLEARANCE_M) else {
                return ControlFlow::Continue(());
            };
            let edge_m = topology.cube.node_edge_m(crossing.depth);
            let index = indices[crossing.depth as usize][row];
            let leaf = &self.leaves[index as usize];
            let opacity = crossing.opacity(leaf.rgba[3], edge_m);
            let ends = left * opacity;
            let backing = closed_to_m.is_finite() && crossing.enter_m <= closed_to_m;
            // Cones blend a leaf with the one behind it, so the latter gets the lamp's light too.
            let behind = backing && crossing.enter_m <= lamp_to_m && (solid || edge_m <= 1.01 * closing_m);
            let arriving = match backing {
                true if behind => came,
                true => 0.0,
                false => left,
            };
            left -= ends;
            let closes = left < CLOSED && closed_to_m.is_infinite();
            if closes {
                (came, closing_m) = (arriving, edge_m);
                closed_to_m = crossing.enter_m + BACKING * edge_m;
                solid = !leaf.closing;
                let backing = if solid { BACKING } else { LAMP_BACKING };
                lamp_to_m = crossing.enter_m + backing * edge_m;
            }
            if leaf.open && (ends >= MIN_SHARE * opacity || backing) {
                let weight = ends.max(BACKING_WEIGHT * opacity);
                deposit_on(Deposit { leaf: index, column: 0, weight, arriving, closes, behind });
            }
            let over = left < MIN_TRANSMITTANCE && crossing.leave_m > closed_to_m;
            if over { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
        });
        let last = last.filter(|last: &Crossing| left > OPEN && last.row.is_none())?;
        let depth = last.depth.max(self.side_depth);
        let end = topology.cube.unit_from_world(ray.origin + ray.direction * last.leave_m);
        let side = (1u32 << depth) as f32;
        let cell = (end * side).clamp(Vec3::ZERO, Vec3::splat(side - 1.0)).as_uvec3();
        // Rounding may have put the end into the adjacent node, which need not be empty.
        let key = key_from_xyz(cell.to_array());
        let (found, node) = topology
            .octree
            .deepest(depth.min(topology.octree.depth()), key >> (3 * depth.saturating_sub(topology.octree.depth())));
        (topology.octree.levels()[found as usize].rows[node] < 0).then_some((depth, key))
    }
}
