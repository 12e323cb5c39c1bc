use std::ops::Index;

use lo_geometry::{Ray, Vec3};
use lo_mesh::{Hit, SurfacePoint};

use crate::objects::object::Object;
use crate::{InsertError, Instance};

/// Surface points of an object that are tested for being inside another.
const INSIDE_POINTS: usize = 256;

/// Smallest depth of a point inside another object, as a share of the smaller radius; objects that only touch do not
/// intersect.
const INSIDE_DEPTH: f32 = 0.01;

/// Distance from a surface at which rays into its own object start, as a share of its radius.
const START: f32 = 1e-5;

/// Distance from a surface at which rays against all objects start, as a share of its object's radius.
const RAY_START: f32 = 2e-4;

/// Smallest share of one object's points inside another for which the two intersect.
const MIN_INSIDE: f32 = 0.01;

/// The objects that are inserted together, as one target of rays.
pub(crate) struct Objects<'a> {
    all: Vec<Object<'a>>,
}

/// Intersection of a ray with one of several objects.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ObjectHit {
    /// Index of the object.
    pub object: usize,
    pub hit: Hit,
}

impl<'a> Objects<'a> {
    /// # Errors
    /// If a model has no extent, or a number of its placement is invalid.
    pub fn new(instances: &[Instance<'a>]) -> Result<Self, InsertError> {
        let object = |(i, instance)| Object::new(instance).map_err(|error| error.of(i));
        Ok(Self { all: instances.iter().enumerate().map(object).collect::<Result<_, _>>()? })
    }

    pub fn len(&self) -> usize {
        self.all.len()
    }

    pub fn iter(&self) -> std::slice::Iter<'_, Object<'a>> {
        self.all.iter()
    }

    /// Returns whether any of them transmits light.
    pub fn have_glass(&self) -> bool {
        self.all.iter().any(|object| object.is_glass)
    }

    /// Returns the nearest surface, facing either way.
    pub fn first(&self, ray: &Ray) -> Option<ObjectHit> {
        self.nearest(f32::INFINITY, |object, before_m| object.first(ray, before_m))
    }

    /// Returns the start of rays against the objects from a point on object `index`, beside its surface on the side of
    /// a unit normal.
    pub fn ray_start(&self, index: usize, position: Vec3, normal: Vec3) -> Vec3 {
        position + normal * (RAY_START * self.all[index].radius_m)
    }

    /// Returns the share of a straight ray's light that the objects' glass before `max_m` lets pass, linear RGB.
    pub fn passed_share(&self, ray: &Ray, max_m: f32) -> Vec3 {
        let glass = self.all.iter().filter(|object| object.is_glass);
        glass.fold(Vec3::ONE, |share, object| share * object.passed(ray, max_m).share)
    }

    /// Returns the first glass of object `index` on a ray that no other object blocks before.
    pub fn glass_of(&self, index: usize, ray: &Ray) -> Option<Hit> {
        let object = &self.all[index];
        let hit = if object.is_glass { object.first(ray, f32::INFINITY) } else { None };
        hit.filter(|hit| self.is_first(index, ray, hit))
    }

    /// Returns the nearest surface before `max_m` that blocks light, facing either way.
    pub fn closest(&self, ray: &Ray, max_m: f32) -> Option<ObjectHit> {
        self.nearest(max_m, |object, before_m| object.closest(ray, before_m))
    }

    /// Returns the nearest of the hits that `hit` finds on each object before a distance.
    fn nearest(&self, max_m: f32, hit: impl Fn(&Object<'a>, f32) -> Option<Hit>) -> Option<ObjectHit> {
        let mut nearest: Option<ObjectHit> = None;
        for (object, candidate) in self.all.iter().enumerate() {
            let before_m = nearest.map_or(max_m, |nearest| nearest.hit.distance_m);
            nearest = hit(candidate, before_m).map(|hit| ObjectHit { object, hit }).or(nearest);
        }
        nearest
    }

    /// Returns whether anything before `max_m` blocks light.
    pub fn blocks(&self, ray: &Ray, max_m: f32) -> bool {
        self.all.iter().any(|object| object.blocks(ray, max_m))
    }

    /// Returns the intersection of a ray with object `index`, unless another object blocks its light before.
    pub fn closest_of(&self, index: usize, ray: &Ray) -> Option<Hit> {
        self.all[index].closest(ray, f32::INFINITY).filter(|hit| self.is_first(index, ray, hit))
    }

    /// Returns whether object `index` blocks a ray's light and no other object does so before.
    pub fn blocked_by(&self, index: usize, ray: &Ray) -> bool {
        // With a single object, the hit itself does not matter.
        let alone = self.len() == 1;
        if alone { self.all[index].blocks(ray, f32::INFINITY) } else { self.closest_of(index, ray).is_some() }
    }

    fn is_first(&self, index: usize, ray: &Ray, hit: &Hit) -> bool {
        self.all.iter().enumerate().all(|(i, other)| i == index || !other.blocks(ray, hit.distance_m))
    }

    /// Returns the nearest surface beyond `from_m` (0: from the start) that is at least partly visible to the camera.
    pub fn seen(&self, ray: &Ray, from_m: f32) -> Option<ObjectHit> {
        let mut nearest: Option<ObjectHit> = None;
        for (object, candidate) in self.all.iter().enumerate() {
            let Some(hit) = candidate.seen(ray, from_m) else { continue };
            if nearest.is_none_or(|nearest| hit.distance_m < nearest.hit.distance_m) {
                nearest = Some(ObjectHit { object, hit });
            }
        }
        nearest
    }

    /// Returns pairs of intersecting objects: part of the surface of one is well inside the other. A model with holes
    /// has no defined inside and never counts.
    pub fn intersecting(&self) -> impl Iterator<Item = [usize; 2]> {
        let pairs = (0..self.len()).flat_map(|b| (0..b).map(move |a| [a, b]));
        pairs.filter(|&[a, b]| {
            let (a, b) = (&self.all[a], &self.all[b]);
            let apart_m = (a.centre_m - b.centre_m).length();
            apart_m < a.radius_m + b.radius_m && (reaches_into(a, b) || reaches_into(b, a))
        })
    }
}

impl<'a> Index<usize> for Objects<'a> {
    type Output = Object<'a>;

    fn index(&self, object: usize) -> &Object<'a> {
        &self.all[object]
    }
}

fn reaches_into(object: &Object, other: &Object) -> bool {
    let depth_m = INSIDE_DEPTH * object.radius_m.min(other.radius_m);
    let points = object.spread_points(INSIDE_POINTS);
    let inside = |point: &SurfacePoint| {
        // Take the middle of thin parts.
        let start = point.position - START * object.radius_m * point.geometric_normal;
        let inwards = Ray { origin: start, direction: -point.geometric_normal };
        let through_m = object.first(&inwards, 2.0 * depth_m).map_or(2.0 * depth_m, |hit| hit.distance_m);
        other.contains(inwards.at(0.5 * through_m))
    };
    let count = points.iter().filter(|point| inside(point)).count();
    count as f32 > MIN_INSIDE * points.len() as f32
}
