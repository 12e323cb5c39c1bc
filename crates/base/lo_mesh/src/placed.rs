use std::ops::ControlFlow;

use lo_geometry::{Quat, Ray, Vec3};

use crate::{Bounds, Hit, PreparedModel, SurfacePoint};

/// Placement of a model in the world: scale, then rotation, then translation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Placement {
    /// Scale in metres per model unit; positive.
    pub scale: f32,
    /// Rotation, a unit quaternion.
    pub rotation: Quat,
    /// World position of the model's origin, in metres.
    pub translation: Vec3,
}

impl Default for Placement {
    /// The identity placement.
    fn default() -> Self {
        Self { scale: 1.0, rotation: Quat::IDENTITY, translation: Vec3::ZERO }
    }
}

impl Placement {
    /// Transforms a model point to world coordinates.
    pub fn world_from_model(&self, point: Vec3) -> Vec3 {
        self.rotation * (point * self.scale) + self.translation
    }

    /// Transforms a world position to model coordinates.
    pub fn model_from_world(&self, point: Vec3) -> Vec3 {
        (self.rotation.conjugate() * (point - self.translation)) / self.scale
    }
}

/// A prepared model placed in the world. Rays are transformed to model coordinates, so that moving the model is free.
#[derive(Clone, Copy, Debug)]
pub struct PlacedModel<'a> {
    /// The model.
    pub prepared: &'a PreparedModel,
    /// Its placement.
    pub placement: Placement,
}

impl PlacedModel<'_> {
    /// Returns the closest visible hit. Skips back faces of single-sided materials and fully transparent points.
    ///
    /// All distances are in world metres.
    pub fn intersect(&self, ray: &Ray, max_distance_m: f32) -> Option<Hit> {
        self.world_hit(self.prepared.intersect(&self.model_ray(ray), max_distance_m / self.placement.scale))
    }

    /// Returns the closest hit of a front or back face. Skips fully transparent points.
    pub fn intersect_both_sides(&self, ray: &Ray, max_distance_m: f32) -> Option<Hit> {
        self.world_hit(self.prepared.intersect_both_sides(&self.model_ray(ray), max_distance_m / self.placement.scale))
    }

    /// Returns all hits of front and back faces within the distance, from near to far, transparent points included.
    pub fn crossings(&self, ray: &Ray, max_distance_m: f32) -> Vec<Hit> {
        let (scale, mut hits) = (self.placement.scale, Vec::new());
        let max = max_distance_m / scale;
        self.prepared.crossings(&self.model_ray(ray), max, |hit| {
            hits.push(Hit { distance_m: hit.distance_m * scale, ..*hit });
            ControlFlow::Continue(max)
        });
        hits.sort_by(|a, b| a.distance_m.total_cmp(&b.distance_m).then(a.triangle.cmp(&b.triangle)));
        hits
    }

    /// Whether a surface that blocks at least half of the light is within the distance.
    pub fn occluded(&self, ray: &Ray, max_distance_m: f32) -> bool {
        self.prepared.occluded(&self.model_ray(ray), max_distance_m / self.placement.scale)
    }

    /// Transmittance along the ray up to the distance.
    pub fn transmittance(&self, ray: &Ray, max_distance_m: f32) -> f32 {
        self.prepared.transmittance(&self.model_ray(ray), max_distance_m / self.placement.scale)
    }

    /// Returns material and normals at a hit, in world coordinates.
    ///
    /// `direction` is the ray's, `footprint_m` the width of the ray's footprint (see [`crate::Model::surface`]).
    ///
    /// # Panics
    /// If `hit` is not one of this model.
    pub fn surface(&self, hit: &Hit, direction: Vec3, footprint_m: f32) -> SurfacePoint {
        let Placement { scale, rotation, .. } = self.placement;
        let local = self.prepared.model().surface(hit, rotation.conjugate() * direction, footprint_m / scale);
        SurfacePoint {
            position: self.placement.world_from_model(local.position),
            geometric_normal: (rotation * local.geometric_normal).normalize(),
            shading_normal: (rotation * local.shading_normal).normalize(),
            ..local
        }
    }

    /// Axis-aligned world box around the model's rotated bounding box; not the smallest one.
    pub fn bounds(&self) -> Bounds {
        let local = self.prepared.bounds();
        let none = Bounds { min: Vec3::INFINITY, max: Vec3::NEG_INFINITY };
        (0..8).fold(none, |bounds, corner| {
            let pick = |axis: usize| if corner >> axis & 1 == 0 { local.min[axis] } else { local.max[axis] };
            let p = self.placement.world_from_model(Vec3::new(pick(0), pick(1), pick(2)));
            Bounds { min: bounds.min.min(p), max: bounds.max.max(p) }
        })
    }

    fn model_ray(&self, ray: &Ray) -> Ray {
        let inverse = self.placement.rotation.conjugate();
        Ray { origin: self.placement.model_from_world(ray.origin), direction: inverse * ray.direction }
    }

    fn world_hit(&self, hit: Option<Hit>) -> Option<Hit> {
        hit.map(|hit| Hit { distance_m: hit.distance_m * self.placement.scale, ..hit })
    }
}
