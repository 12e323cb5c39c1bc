use lo_geometry::{Mat3, Plane, Ray, Vec3};
use lo_mesh::{AlphaMode, Hit, PlacedModel, SurfacePoint};

use crate::objects::glass::{Passed, Sight, always_lets_light_pass, blocked_share, lets_light_pass, sight};
use crate::pattern::hammersley;
use crate::{InsertError, Instance};

/// Smallest alpha that blocks light. Light rays treat a surface as present or absent; camera rays blend.
const LIGHT_ALPHA: f32 = 0.5;

/// Transparent layers that a light ray passes before it counts as unoccluded.
const MAX_LAYERS: usize = 16;

/// Surface points of an object that are tested for being transparent.
const ALPHA_POINTS: usize = 256;

/// Largest number of surfaces counted by the inside test.
const MAX_CROSSINGS: usize = 1000;

/// A model placed in the world.
pub(crate) struct Object<'a> {
    placed: PlacedModel<'a>,
    /// Rotation from world directions to the object's own axes.
    local_from_world: Mat3,
    /// Centre of the bounding box, world frame.
    pub centre_m: Vec3,
    /// Radius of the sphere around the bounding box.
    pub radius_m: f32,
    /// Lowest corner of the bounding box in the object's own axes, see [`Object::to_local_point`].
    pub low_m: Vec3,
    /// Highest corner of the bounding box in the object's own axes.
    pub high_m: Vec3,
    /// The surface that the object stands on.
    pub support: Option<Plane>,
    /// Placement in the previous and in the next image.
    moves: Option<[lo_mesh::Placement; 2]>,
    /// Whether part of it is transparent.
    pub is_see_through: bool,
    /// Whether part of it transmits light.
    pub is_glass: bool,
    /// Whether all of it lets light pass.
    is_all_glass: bool,
}

impl<'a> Object<'a> {
    /// # Errors
    /// If the model has no extent, or a number of the placement is invalid.
    pub fn new(&Instance { model: prepared, placement, moves, .. }: &Instance<'a>) -> Result<Self, InsertError> {
        placement.check()?;
        let bounds = prepared.bounds();
        let (size, centre) = (bounds.size(), bounds.center());
        if !(size.is_finite() && size.max_element() > 0.0) {
            return Err(InsertError::EmptyModel(format!("its bounding box is {} to {}", bounds.min, bounds.max)));
        }
        let placed = PlacedModel { prepared, placement: placement.of_model(prepared.base_bounds()) };
        let lo_mesh::Placement { scale, rotation, .. } = placed.placement;
        let materials = &prepared.model().materials;
        let is_glass = materials.iter().any(|material| material.transmission > 0.0);
        Ok(Self {
            centre_m: placed.placement.world_from_model(centre),
            placed,
            local_from_world: Mat3::from_quat(rotation.conjugate()),
            radius_m: 0.5 * size.length() * scale,
            low_m: bounds.min * scale,
            high_m: bounds.max * scale,
            support: placement.support,
            moves: moves.map(|moves| moves.map(|placement| placement.of_model(prepared.base_bounds()))),
            is_see_through: is_glass || materials.iter().any(|material| material.alpha_mode == AlphaMode::Blend),
            is_glass,
            is_all_glass: materials.iter().enumerate().all(|(index, material)| {
                let is_used = prepared.model().triangle_materials.contains(&(index as u32));
                !is_used || always_lets_light_pass(material)
            }),
        })
    }

    /// Rotates a world direction to the object's own axes.
    pub fn to_local(&self, direction: Vec3) -> Vec3 {
        self.local_from_world * direction
    }

    /// Transforms a world point to the object's own axes, in metres.
    pub fn to_local_point(&self, point: Vec3) -> Vec3 {
        self.to_local(point - self.placed.placement.translation)
    }

    /// Returns the corners of the bounding box, world frame.
    pub fn corners(&self) -> [Vec3; 8] {
        let lo_mesh::Placement { rotation, translation, .. } = self.placed.placement;
        std::array::from_fn(|i| {
            let pick = |axis: usize| if i >> axis & 1 == 0 { self.low_m[axis] } else { self.high_m[axis] };
            translation + rotation * Vec3::new(pick(0), pick(1), pick(2))
        })
    }

    /// Returns whether a ray misses the object's box; cheaper than a test of the triangles.
    fn misses(&self, ray: &Ray) -> bool {
        let offset = self.centre_m - ray.origin;
        let along = offset.dot(ray.direction);
        let (squared, radius) = (offset.length_squared(), self.radius_m * self.radius_m);
        if squared - along * along > radius || (along < 0.0 && squared > radius) {
            return true;
        }
        let (origin, inverse) = (self.to_local_point(ray.origin), self.to_local(ray.direction).recip());
        let margin = Vec3::splat(1e-4 * self.radius_m);
        let (a, b) = ((self.low_m - margin - origin) * inverse, (self.high_m + margin - origin) * inverse);
        a.max(b).min_element() < a.min(b).max_element().max(0.0)
    }

    /// Returns the nearest surface before `max_m`, facing either way.
    pub fn first(&self, ray: &Ray, max_m: f32) -> Option<Hit> {
        if self.misses(ray) { None } else { self.placed.intersect_both_sides(ray, max_m) }
    }

    /// Returns the nearest surface before `max_m` that blocks light, facing either way; glass does not.
    pub fn closest(&self, ray: &Ray, max_m: f32) -> Option<Hit> {
        if self.is_all_glass || self.misses(ray) {
            return None;
        }
        let mut from_m = 0.0;
        for _ in 0..MAX_LAYERS {
            let hit = self.beyond(ray, from_m, max_m, PlacedModel::intersect_both_sides)?;
            if !self.is_see_through {
                return Some(hit);
            }
            let point = self.placed.surface(&hit, ray.direction, 0.0);
            if point.alpha >= LIGHT_ALPHA && !lets_light_pass(&point) {
                return Some(hit);
            }
            from_m = hit.distance_m;
        }
        None
    }

    /// Returns the light of a straight ray that passes the object's glass before `max_m`.
    pub fn passed(&self, ray: &Ray, max_m: f32) -> Passed {
        let mut passed = Passed::ALL;
        if !self.is_glass || self.misses(ray) {
            return passed;
        }
        let mut before_m = f32::NEG_INFINITY;
        for hit in self.placed.crossings(ray, max_m) {
            // A ray through a shared edge meets two triangles.
            if hit.distance_m - before_m < 1e-5 * self.radius_m {
                continue;
            }
            before_m = hit.distance_m;
            let point = self.placed.surface(&hit, ray.direction, 0.0);
            if lets_light_pass(&point) {
                passed.cross(&point, -ray.direction, hit.distance_m);
            }
        }
        passed
    }

    /// Returns whether anything before `max_m` blocks light.
    pub fn blocks(&self, ray: &Ray, max_m: f32) -> bool {
        if self.is_glass {
            return self.closest(ray, max_m).is_some();
        }
        !self.misses(ray) && self.placed.occluded(ray, max_m)
    }

    /// Returns whether its materials make all of it invisible.
    pub fn is_transparent(&self) -> bool {
        self.spread_points(ALPHA_POINTS).iter().all(|point| point.alpha == 0.0)
    }

    /// Returns the nearest surface beyond `from_m` (0: from the start) that is at least partly visible to the camera.
    pub fn seen(&self, ray: &Ray, from_m: f32) -> Option<Hit> {
        if self.misses(ray) { None } else { self.beyond(ray, from_m, f32::INFINITY, PlacedModel::intersect) }
    }

    /// Returns whether a world point is inside: along two of three directions, the number of crossed surfaces is odd
    /// (Jordan).
    pub fn contains(&self, point: Vec3) -> bool {
        let is_odd = |direction: Vec3| {
            let ray = Ray { origin: point, direction };
            let (mut from_m, mut met) = (0.0, 0usize);
            while let Some(hit) = self.beyond(&ray, from_m, f32::INFINITY, PlacedModel::intersect_both_sides) {
                (from_m, met) = (hit.distance_m, met + 1);
                if met == MAX_CROSSINGS {
                    break;
                }
            }
            met % 2 == 1
        };
        let in_box = |local: Vec3| local.cmpge(self.low_m).all() && local.cmple(self.high_m).all();
        // Directions that are unlikely to be parallel to the model's faces.
        let directions = [Vec3::new(0.36, 0.48, 0.8), Vec3::new(-0.64, 0.6, 0.48), Vec3::new(0.28, -0.96, 0.0)];
        in_box(self.to_local_point(point)) && directions.into_iter().filter(|&direction| is_odd(direction)).count() >= 2
    }

    /// Applies `intersect` to a ray beyond `from_m`.
    fn beyond(
        &self,
        ray: &Ray,
        from_m: f32,
        max_m: f32,
        intersect: impl Fn(&PlacedModel<'a>, &Ray, f32) -> Option<Hit>,
    ) -> Option<Hit> {
        if from_m == 0.0 {
            return intersect(&self.placed, ray, max_m);
        }
        let start_m = from_m + 1e-4 * self.radius_m;
        let rest = Ray { origin: ray.at(start_m), direction: ray.direction };
        let hit = intersect(&self.placed, &rest, max_m - start_m)?;
        Some(Hit { distance_m: hit.distance_m + start_m, ..hit })
    }

    /// Whether it is known where the object is in other images.
    pub fn moves(&self) -> bool {
        self.moves.is_some()
    }

    /// Returns where a world point of the object is in the previous and in the next image, if it moves.
    pub fn moved(&self, point: Vec3) -> Option<[Vec3; 2]> {
        let local = self.placed.placement.model_from_world(point);
        self.moves.map(|moves| moves.map(|placement| placement.world_from_model(local)))
    }

    /// Returns the index of a triangle's material.
    pub fn material_of(&self, triangle: u32) -> u32 {
        self.placed.prepared.model().triangle_materials[triangle as usize]
    }

    /// Returns the name of a material.
    pub fn material_name(&self, material: u32) -> &str {
        &self.placed.prepared.model().materials[material as usize].name
    }

    /// Returns the unit normal of a triangle's front, world frame.
    pub fn triangle_normal(&self, triangle: u32) -> Vec3 {
        self.placed.placement.rotation * self.local_triangle_normal(triangle)
    }

    /// Returns the unit normal of a triangle's front, in the object's own axes.
    pub fn local_triangle_normal(&self, triangle: u32) -> Vec3 {
        let model = self.placed.prepared.model();
        let [a, b, c] = model.triangles[triangle as usize].map(|v| model.positions[v as usize]);
        (b - a).cross(c - a).normalize_or(Vec3::Y)
    }

    /// Returns material and shading frame at a hit; textures are averaged over a width of `footprint_m`. Alpha is
    /// reduced where a pane shows the photo.
    pub fn surface(&self, ray: &Ray, hit: &Hit, footprint_m: f32) -> SurfacePoint {
        let point = self.placed.surface(hit, ray.direction, footprint_m);
        if sight(&point) == Sight::Pane {
            return SurfacePoint { alpha: point.alpha * blocked_share(&point, -ray.direction), ..point };
        }
        point
    }

    /// Returns `count` points spread over the surface by area, seen from their fronts. They are deterministic per
    /// model.
    pub fn spread_points(&self, count: usize) -> Vec<SurfacePoint> {
        let model = self.placed.prepared.model();
        let area = |triangle: &[u32; 3]| {
            let [a, b, c] = triangle.map(|v| model.positions[v as usize].as_dvec3());
            0.5 * (b - a).cross(c - a).length()
        };
        let total: f64 = model.triangles.iter().map(area).sum();
        let footprint_m = (total / count as f64).sqrt() as f32 * self.placed.placement.scale;
        let mut points = Vec::with_capacity(count);
        let mut before = 0.0;
        for (index, triangle) in model.triangles.iter().enumerate() {
            before += area(triangle);
            // Steps i + ½ of the cumulative area within this triangle, each at its own position.
            while points.len() < count && (points.len() as f64 + 0.5) / count as f64 * total < before {
                let spot = hammersley(points.len(), count).x;
                let root = (points.len() as f32 * 0.754_877_7).fract().sqrt();
                let hit =
                    Hit { distance_m: 0.0, triangle: index as u32, barycentric: [root * (1.0 - spot), root * spot] };
                points.push(self.placed.surface(&hit, -self.triangle_normal(hit.triangle), footprint_m));
            }
        }
        points
    }
}
