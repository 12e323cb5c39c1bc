use std::ops::ControlFlow;

use lo_geometry::Vec3;
use obvhs::cwbvh::CwBvh;
use obvhs::cwbvh::bvh2_to_cwbvh::bvh2_to_cwbvh;

use crate::Model;
use crate::sah::{self, Box3};
use crate::triangle::{Crossing, ShearedRay};

/// Exponent of the power of two just above the hierarchy's largest coordinate.
///
/// The traversal uses absolute tolerances (1e-4), which are thus 1e-7 of any model's size.
const LARGEST_EXPONENT: i32 = 10;

/// Padding of boxes, so that rounding in the box test never misses a triangle: a few units in the last place of the
/// largest coordinate.
const PADDING: f32 = 5e-4;

/// An eight-wide bounding volume hierarchy (Ylitie et al. 2017) over a model's triangles.
#[derive(Clone, Debug)]
pub(crate) struct MeshBvh {
    hierarchy: CwBvh,
    /// Scaled triangle corners, in the order of the hierarchy's leaves.
    corners: Vec<[Vec3; 3]>,
    /// Scale from model to hierarchy coordinates, a power of two: multiplication is exact.
    scale: f32,
}

/// A triangle crossed by a ray.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Candidate {
    /// Triangle index in the model.
    pub triangle: u32,
    /// The crossing, with its distance in model units.
    pub crossing: Crossing,
}

impl MeshBvh {
    /// Builds the hierarchy. The result does not depend on machine or thread count.
    pub(crate) fn build(model: &Model) -> Self {
        if model.triangles.is_empty() {
            return Self { hierarchy: CwBvh::default(), corners: Vec::new(), scale: 1.0 };
        }
        let largest =
            model.positions.iter().filter(|p| p.is_finite()).map(|p| p.abs().max_element()).fold(0.0, f32::max);
        let scale = scale_below(largest);
        let corners: Vec<[Vec3; 3]> =
            model.triangles.iter().map(|t| t.map(|vertex| model.positions[vertex as usize] * scale)).collect();
        let boxes: Vec<Box3> = corners.iter().map(|&t| Box3::around(t).grown(PADDING)).collect();
        let binary = sah::build(&boxes);
        drop(boxes);
        let mut hierarchy = bvh2_to_cwbvh(&binary, 3, true, false);
        drop(binary);
        let corners = hierarchy.primitive_indices.iter().map(|&t| corners[t as usize]).collect();
        hierarchy.primitive_indices.shrink_to_fit();
        hierarchy.nodes.shrink_to_fit();
        Self { hierarchy, corners, scale }
    }

    /// Calls `visit` for the triangles that a ray crosses within `max_distance` model units, until it breaks.
    ///
    /// The order is roughly from near to far. `visit` returns the distance beyond which crossings may be skipped.
    /// `direction` must be finite and not zero.
    #[inline]
    #[allow(unsafe_code)]
    pub(crate) fn crossings(
        &self,
        origin: Vec3,
        direction: Vec3,
        max_distance: f32,
        visit: impl FnMut(Candidate) -> ControlFlow<(), f32>,
    ) {
        #[cfg(target_arch = "x86_64")]
        if is_x86_feature_detected!("avx2")
            && is_x86_feature_detected!("bmi1")
            && is_x86_feature_detected!("bmi2")
            && is_x86_feature_detected!("lzcnt")
            && is_x86_feature_detected!("popcnt")
        {
            // SAFETY: the processor supports all target features of the function.
            return unsafe { self.traverse_avx2(origin, direction, max_distance, visit) };
        }
        self.traverse(origin, direction, max_distance, visit);
    }

    /// [`MeshBvh::traverse`] compiled for processors since 2013: 1.17 × as many camera rays, 1.07 × as many shadow
    /// rays.
    ///
    /// Without fused multiply-add, so that every processor gives the same result.
    #[cfg(target_arch = "x86_64")]
    #[target_feature(enable = "avx2,bmi1,bmi2,lzcnt,popcnt")]
    fn traverse_avx2(
        &self,
        origin: Vec3,
        direction: Vec3,
        max_distance: f32,
        visit: impl FnMut(Candidate) -> ControlFlow<(), f32>,
    ) {
        self.traverse(origin, direction, max_distance, visit);
    }

    #[inline(always)]
    fn traverse(
        &self,
        origin: Vec3,
        direction: Vec3,
        max_distance: f32,
        mut visit: impl FnMut(Candidate) -> ControlFlow<(), f32>,
    ) {
        let origin = origin * self.scale;
        if !(origin.is_finite() && direction.is_finite() && max_distance > 0.0) || self.hierarchy.nodes.is_empty() {
            return;
        }
        // Adding zero turns -0 into 0; the box test would misread the sign of -0.
        let direction = direction + Vec3::ZERO;
        let max_distance = max_distance * self.scale;
        let sheared = ShearedRay::new(origin, direction);
        let mut ray = obvhs::ray::Ray::new(origin.into(), direction.into(), 0.0, max_distance);
        let octants = self.hierarchy.new_traversal(direction.into()).oct_inv4;
        let mut stack = TraversalStack::new();
        // Groups as in the paper: base index, and hit bits of children (upper byte) or triangles (lower 24).
        let (mut nodes, mut triangles) = ((0_u32, 0x8000_0000_u32), (0_u32, 0_u32));
        loop {
            while triangles.1 != 0 {
                let bit = 31 - triangles.1.leading_zeros();
                triangles.1 &= !(1 << bit);
                let at = (triangles.0 + bit) as usize;
                if let Some(mut crossing) = sheared.intersect(self.corners[at], 0.0, ray.tmax) {
                    crossing.distance /= self.scale;
                    let triangle = self.hierarchy.primitive_indices[at];
                    match visit(Candidate { triangle, crossing }) {
                        ControlFlow::Break(()) => return,
                        ControlFlow::Continue(max_distance) => ray.tmax = ray.tmax.min(max_distance * self.scale),
                    }
                }
            }
            if nodes.1 & 0xff00_0000 == 0 {
                match stack.pop() {
                    Some(group) => nodes = group,
                    None => return,
                }
            }
            let child = 31 - nodes.1.leading_zeros();
            let hits = nodes.1;
            nodes.1 &= !(1 << child);
            if nodes.1 & 0xff00_0000 != 0 {
                stack.push(nodes);
            }
            let slot = (child - 24) ^ (octants & 0xff);
            let before = (hits & !(u32::MAX << slot)).count_ones();
            let node = &self.hierarchy.nodes[(nodes.0 + before) as usize];
            let mask = node.intersect_ray(&ray, octants);
            nodes = (node.child_base_idx, (mask & 0xff00_0000) | u32::from(node.imask));
            triangles = (node.primitive_base_idx, mask & 0x00ff_ffff);
        }
    }
}

/// Returns the power of two that scales `largest` to just below 2^[`LARGEST_EXPONENT`].
fn scale_below(largest: f32) -> f32 {
    if largest == 0.0 {
        return 1.0;
    }
    let exponent = f64::from(largest).log2().floor() as i32 + 1;
    // Clamped so that the power is exact even near the limits of f32.
    2_f32.powi((LARGEST_EXPONENT - exponent).clamp(-126, 126))
}

/// A stack of unlimited depth. The library's own stack panics beyond 32 entries, and a malicious mesh can be deeper.
struct TraversalStack {
    inline: [(u32, u32); 32],
    length: usize,
    overflow: Vec<(u32, u32)>,
}

impl TraversalStack {
    fn new() -> Self {
        Self { inline: [(0, 0); 32], length: 0, overflow: Vec::new() }
    }

    #[inline]
    fn push(&mut self, group: (u32, u32)) {
        match self.inline.get_mut(self.length) {
            Some(slot) => {
                *slot = group;
                self.length += 1;
            }
            None => self.overflow.push(group),
        }
    }

    #[inline]
    fn pop(&mut self) -> Option<(u32, u32)> {
        if let Some(group) = self.overflow.pop() {
            return Some(group);
        }
        self.length = self.length.checked_sub(1)?;
        Some(self.inline[self.length])
    }
}

#[cfg(test)]
mod tests {
    use lo_geometry::fibonacci_sphere;

    use super::*;
    use crate::Material;

    #[test]
    fn every_processor_finds_the_same() {
        let points = fibonacci_sphere(600);
        let mut model = Model { materials: vec![Material::default()], ..Model::default() };
        for i in 0..2000_u32 {
            let from = points[i as usize % 600] * (0.1 + i as f32 / 1000.0);
            let corner = |k: u32| from + points[(i * 7 + k * 211) as usize % 600] * 0.2;
            model.positions.extend([corner(0), corner(1), corner(2)]);
            model.triangles.push([3 * i, 3 * i + 1, 3 * i + 2]);
            model.triangle_materials.push(0);
        }
        let bvh = MeshBvh::build(&model);
        let mut found = 0;
        for direction in fibonacci_sphere(500) {
            let (mut plain, mut chosen) = (Vec::new(), Vec::new());
            let note = |list: &mut Vec<(u32, u32)>, candidate: Candidate| {
                list.push((candidate.triangle, candidate.crossing.distance.to_bits()));
                ControlFlow::Continue(f32::INFINITY)
            };
            bvh.traverse(Vec3::splat(0.01), direction, 10.0, |candidate| note(&mut plain, candidate));
            bvh.crossings(Vec3::splat(0.01), direction, 10.0, |candidate| note(&mut chosen, candidate));
            assert_eq!(plain, chosen);
            found += plain.len();
        }
        assert!(found > 1000, "{found}");
    }
}
