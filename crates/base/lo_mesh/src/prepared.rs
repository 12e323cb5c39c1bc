use std::ops::ControlFlow;

use lo_geometry::{Ray, Vec3};

use crate::bvh::{Candidate, MeshBvh};
use crate::{AlphaMode, Bounds, Model};

/// An intersection of a ray with a model.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hit {
    /// Distance along the ray in metres.
    pub distance_m: f32,
    /// Triangle index.
    pub triangle: u32,
    /// Barycentric weights of the second and third vertex.
    pub barycentric: [f32; 2],
}

/// A model with its acceleration structure for ray casting; immutable.
///
/// All coordinates are model coordinates ([`crate::PlacedModel`] places it in the world).
#[derive(Clone, Debug)]
pub struct PreparedModel {
    model: Model,
    bounds: Bounds,
    /// Bounding box that placements refer to.
    base_bounds: Bounds,
    bvh: MeshBvh,
    /// Whether any used material has alpha.
    has_alpha: bool,
    /// Whether any used material is single-sided.
    has_single_sided: bool,
}

impl PreparedModel {
    /// Builds the bounding volume hierarchy.
    pub fn new(model: Model) -> Self {
        let used = |property: fn(&crate::Material) -> bool| {
            let having: Vec<bool> = model.materials.iter().map(property).collect();
            model.triangle_materials.iter().any(|&m| having[m as usize])
        };
        let bounds = model.bounds();
        Self {
            bounds,
            base_bounds: bounds,
            bvh: MeshBvh::build(&model),
            has_alpha: used(|m| m.alpha_mode != AlphaMode::Opaque),
            has_single_sided: used(|m| !m.double_sided),
            model,
        }
    }

    /// The model.
    pub fn model(&self) -> &Model {
        &self.model
    }

    /// Bounding box of all triangles.
    pub fn bounds(&self) -> Bounds {
        self.bounds
    }

    /// Returns the model with the base of another one: a pose of an animated model is placed as its first.
    #[must_use]
    pub fn with_base_of(self, first: &Self) -> Self {
        Self { base_bounds: first.base_bounds, ..self }
    }

    /// Bounding box that placements refer to: the model's own, except for [poses](Self::with_base_of).
    pub fn base_bounds(&self) -> Bounds {
        self.base_bounds
    }

    /// Returns the closest visible hit. Skips back faces of single-sided materials and fully transparent points.
    pub fn intersect(&self, ray: &Ray, max_distance_m: f32) -> Option<Hit> {
        self.closest(ray, max_distance_m, true)
    }

    /// Returns the closest hit of a front or back face. Skips fully transparent points.
    pub fn intersect_both_sides(&self, ray: &Ray, max_distance_m: f32) -> Option<Hit> {
        self.closest(ray, max_distance_m, false)
    }

    /// Whether a surface that blocks at least half of the light, front or back face, is within the distance.
    pub fn occluded(&self, ray: &Ray, max_distance_m: f32) -> bool {
        let mut blocked = false;
        self.bvh.crossings(ray.origin, ray.direction, max_distance_m, |candidate| {
            if !self.has_alpha || self.model.alpha(&hit_from(&candidate)) >= 0.5 {
                blocked = true;
                return ControlFlow::Break(());
            }
            ControlFlow::Continue(max_distance_m)
        });
        blocked
    }

    /// Transmittance along the ray up to the distance: the product of 1 − alpha of all surfaces.
    pub fn transmittance(&self, ray: &Ray, max_distance_m: f32) -> f32 {
        if !self.has_alpha {
            return if self.occluded(ray, max_distance_m) { 0.0 } else { 1.0 };
        }
        let mut passed = 1.0;
        self.bvh.crossings(ray.origin, ray.direction, max_distance_m, |candidate| {
            passed *= 1.0 - self.model.alpha(&hit_from(&candidate));
            if passed > 0.0 { ControlFlow::Continue(max_distance_m) } else { ControlFlow::Break(()) }
        });
        passed
    }

    /// Calls `visit` for every triangle that the ray crosses within the distance, until it breaks.
    ///
    /// Includes back faces and transparent surfaces. The order is roughly from near to far. `visit` returns the
    /// distance beyond which crossings may be skipped.
    pub fn crossings(&self, ray: &Ray, max_distance_m: f32, mut visit: impl FnMut(&Hit) -> ControlFlow<(), f32>) {
        self.bvh.crossings(ray.origin, ray.direction, max_distance_m, |candidate| visit(&hit_from(&candidate)));
    }

    fn closest(&self, ray: &Ray, max_distance_m: f32, cull: bool) -> Option<Hit> {
        let cull = cull && self.has_single_sided;
        let mut best: Option<Hit> = None;
        let mut limit_m = max_distance_m;
        self.bvh.crossings(ray.origin, ray.direction, max_distance_m, |candidate| {
            let hit = hit_from(&candidate);
            // Ties go to the lowest index, so that the result does not depend on the traversal order.
            let nearer = best.is_none_or(|b| (hit.distance_m, hit.triangle) < (b.distance_m, b.triangle));
            let hidden = || {
                let material = self.model.triangle_materials[hit.triangle as usize] as usize;
                (cull && !candidate.crossing.front && !self.model.materials[material].double_sided)
                    || (self.has_alpha && self.model.alpha(&hit) == 0.0)
            };
            if nearer && !hidden() {
                best = Some(hit);
                limit_m = hit.distance_m;
            }
            ControlFlow::Continue(limit_m)
        });
        best
    }
}

fn hit_from(candidate: &Candidate) -> Hit {
    Hit {
        distance_m: candidate.crossing.distance,
        triangle: candidate.triangle,
        barycentric: candidate.crossing.barycentric,
    }
}

/// Offsets the origin of a ray that leaves a surface at `position`, to avoid self-intersection.
///
/// Moves it along the normal (towards the side that the ray leaves on) by the least amount that is safe under rounding
/// (Wächter & Binder 2019, Ray Tracing Gems ch. 6).
pub fn offset_origin(position: Vec3, normal: Vec3) -> Vec3 {
    /// Coordinate below which a fixed distance is added; above it, units in the last place.
    const NEAR_ZERO: f32 = 1.0 / 32.0;
    const FIXED: f32 = 1.0 / 65536.0;
    const LAST_PLACES: f32 = 256.0;
    let moved = |p: f32, n: f32| {
        if p.abs() < NEAR_ZERO {
            return p + FIXED * n;
        }
        let places = (LAST_PLACES * n) as i32;
        f32::from_bits(p.to_bits().wrapping_add_signed(if p < 0.0 { -places } else { places }))
    };
    Vec3::new(moved(position.x, normal.x), moved(position.y, normal.y), moved(position.z, normal.z))
}
