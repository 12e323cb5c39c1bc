//! Places for new objects, beside those that are there.

use lo_geometry::Vec3;

use crate::snap::{is_hidden, standing, tolerance_m};
use crate::{Object, ObjectPosition, OpenScene};

/// Distance between objects, metres.
const GAP_M: f32 = 0.02;

/// Rings searched around a taken place, and positions on each.
const RINGS: usize = 40;
const PER_RING: usize = 12;

/// Smallest distance between rings, metres.
const RING_M: f32 = 0.03;

/// Upright cylinder around an object.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Footprint {
    base_m: Vec3,
    up: Vec3,
    radius_m: f32,
    height_m: f32,
}

impl Footprint {
    /// Returns the cylinder of a placed object.
    pub fn of(object: &Object) -> Self {
        let size_m = object.mesh.size() * object.placement.scale;
        Self {
            base_m: object.placement.position_m,
            up: object.placement.up,
            radius_m: 0.5 * size_m.x.max(size_m.z),
            height_m: size_m.y,
        }
    }

    /// Returns whether two objects reach into each other.
    pub fn overlaps(&self, other: &Self) -> bool {
        let apart = other.base_m - self.base_m;
        let rise_m = apart.dot(self.up);
        let is_beside = apart.reject_from(self.up).length() >= self.radius_m + other.radius_m + GAP_M;
        !is_beside && rise_m < self.height_m && -rise_m < other.height_m
    }
}

/// Returns the position next to a placed object at which it reaches into none of `others`: on the same level, or in the
/// air if it does not stand. `None` if its own position is free, or there is no free one nearby.
pub(crate) fn beside(scene: &OpenScene, object: &Object, others: &[Object]) -> Option<ObjectPosition> {
    let others: Vec<Footprint> = others.iter().filter(|other| other.id != object.id).map(Footprint::of).collect();
    let own = Footprint::of(object);
    let is_free = |base_m: Vec3| !others.iter().any(|other| Footprint { base_m, ..own }.overlaps(other));
    if is_free(own.base_m) {
        return None;
    }
    let right = Vec3::X.reject_from(own.up).normalize_or(Vec3::X);
    let ahead = own.up.cross(right);
    let camera = scene.estimate().frame.camera;
    let step_m = (0.5 * own.radius_m).max(RING_M);
    let at = |index: usize| {
        let (ring, angle) = (index / PER_RING + 1, std::f32::consts::TAU * (index % PER_RING) as f32 / PER_RING as f32);
        let (sin, cos) = angle.sin_cos();
        let point_m = own.base_m + (right * cos + ahead * sin) * (step_m * ring as f32);
        let (u, v, _) = camera.project(point_m)?;
        if !camera.contains(u, v) {
            return None;
        }
        if object.placement.support.is_none() {
            let is_there = is_free(point_m) && !is_hidden(scene, point_m);
            return is_there.then(|| ObjectPosition::Position(point_m.to_array().map(f64::from)));
        }
        let rests = standing(scene, object, [u, v])?;
        let rise_m = (rests.position_m - own.base_m).dot(own.up);
        let is_there = rise_m.abs() <= 2.0 * tolerance_m(scene, rests.position_m) && is_free(rests.position_m);
        is_there.then_some(ObjectPosition::Pixel([u, v]))
    };
    (0..RINGS * PER_RING).find_map(at)
}
