//! Traversal of an octree's leaves along a ray.

use std::ops::ControlFlow;

use lo_geometry::{Ray, Vec3};
use lo_octree::{LightOctree, key_from_xyz};

/// Step across faces between nodes, in edges of the finest node: larger than the rounding of coordinates up to 1024.
const OVER: f32 = 1e-3;

/// A node without children on the path of a ray.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Crossing {
    /// Depth of the node.
    pub depth: u32,
    /// Feature row; `None` for an empty node.
    pub row: Option<usize>,
    /// Distances in metres from the ray's origin at which the ray enters and leaves the node.
    pub enter_m: f32,
    pub leave_m: f32,
}

impl Crossing {
    /// Returns the opacity of this path through a node whose full crossing has opacity `alpha`, with this edge.
    pub fn opacity(&self, alpha: f32, edge_m: f32) -> f32 {
        1.0 - (1.0 - alpha).powf((self.leave_m - self.enter_m) / edge_m)
    }
}

/// Visits the nodes along a ray, including empty ones, until it leaves the cube or `visit` breaks.
pub(crate) fn march(light: &LightOctree, ray: &Ray, mut visit: impl FnMut(Crossing) -> ControlFlow<()>) {
    let Some((near_m, far_m)) = light.cube.intersect(ray) else { return };
    let depth = light.octree.depth();
    let side = (1u32 << depth) as f32;
    let scale = side / light.cube.edge_m;
    // In edges of the finest node from the cube's lowest corner.
    let origin = (ray.origin - light.cube.origin_m) * scale;
    let inverse = ray.direction.recip();
    let (mut at, far) = (near_m * scale, far_m * scale);
    while at < far {
        let point = (origin + (at + OVER) * ray.direction).clamp(Vec3::ZERO, Vec3::splat(side - 1.0));
        let cell = point.as_uvec3();
        let (found, node) = light.octree.deepest(depth, key_from_xyz(cell.to_array()));
        let shift = depth - found;
        let low = Vec3::from_array(cell.to_array().map(|c| (c >> shift << shift) as f32));
        let exits = (low - origin) * inverse;
        let exits = exits.max((low + (1u32 << shift) as f32 - origin) * inverse);
        // Along an axis on which the ray does not move there is no exit: its bounds are infinite or NaN.
        let leave = exits.to_array().into_iter().filter(|t| !t.is_nan()).fold(far, f32::min).max(at + OVER);
        let row = usize::try_from(light.octree.levels()[found as usize].rows[node]).ok();
        if visit(Crossing { depth: found, row, enter_m: at / scale, leave_m: leave / scale }).is_break() {
            return;
        }
        at = leave;
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use lo_geometry::{Cube, fibonacci_sphere};
    use lo_octree::{Provenance, RadiancePoint};

    use super::*;

    #[test]
    fn a_ray_visits_every_node_that_it_crosses_in_order() {
        let points: Vec<RadiancePoint> = fibonacci_sphere(400)
            .iter()
            .map(|d| RadiancePoint { position_m: 1.7 * *d, radiance: [1.0; 3], provenance: Provenance::Inferred })
            .collect();
        let light = LightOctree::from_points(&points, Cube::centred(Vec3::ZERO, 4.0), 6, 2).unwrap().0;
        for direction in fibonacci_sphere(150).into_iter().chain([Vec3::X, Vec3::NEG_Y, Vec3::Z]) {
            let ray = Ray { origin: Vec3::new(0.21, -0.13, 0.4), direction };
            let mut crossings = Vec::new();
            march(&light, &ray, |crossing| {
                crossings.push(crossing);
                ControlFlow::Continue(())
            });
            let (_, far) = light.cube.intersect(&ray).unwrap();
            assert!(crossings.len() > 2 && crossings[0].enter_m == 0.0);
            assert!((crossings[crossings.len() - 1].leave_m - far).abs() < 1e-3);
            for pair in crossings.windows(2) {
                assert_eq!(pair[0].leave_m, pair[1].enter_m);
            }
            // The middle of each crossing is in its node, as found by a lookup.
            for crossing in crossings.iter().filter(|c| c.leave_m - c.enter_m > 1e-3) {
                let middle = ray.origin + 0.5 * (crossing.enter_m + crossing.leave_m) * direction;
                let (depth, node) = light.locate(middle, 6).unwrap();
                let row = usize::try_from(light.octree.levels()[depth as usize].rows[node]).ok();
                assert_eq!((depth, row), (crossing.depth, crossing.row), "{direction} {crossing:?}");
            }
        }
    }

    #[test]
    fn half_a_crossing_lets_the_root_through() {
        let half = Crossing { depth: 3, row: None, enter_m: 1.0, leave_m: 1.25 };
        assert!((half.opacity(0.75, 0.5) - 0.5).abs() < 1e-6);
    }
}
