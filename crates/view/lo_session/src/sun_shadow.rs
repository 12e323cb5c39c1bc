//! Shadows that a sun casts of an object's top: where they fall, and the sun's direction for a wanted place.

use lo_geometry::{Plane, Ray, Vec3};

use crate::snap::tolerance_m;
use crate::{Object, OpenScene};

/// Steps of the search for the surface that a shadow falls on, and its length, metres.
const STEP_M: f32 = 0.01;
const REACH_M: f32 = 12.0;

/// Smallest sine of a sun's elevation at which objects have shadows.
const MIN_SINE: f32 = 0.02;

/// Returns the point whose shadow is shown: the middle of the object's top.
fn top_m(object: &Object) -> Vec3 {
    let placement = object.placement;
    placement.position_m + placement.up * (object.mesh.size().y * placement.scale)
}

/// Returns the plane that the object's base is in.
fn base(object: &Object) -> Plane {
    Plane::through(object.placement.position_m, object.placement.up)
}

/// Returns the unit direction towards the sun for which the shadow of an object's top falls on the surface seen at a
/// pixel, or where there is none, on the plane of its base. `None` if the sun would be at or below the horizon.
pub(crate) fn direction_of_shadow(scene: &OpenScene, object: &Object, [u, v]: [f64; 2]) -> Option<Vec3> {
    let camera = scene.estimate().frame.camera;
    let on_base = || {
        let ray = Ray { origin: Vec3::ZERO, direction: camera.direction(u, v) };
        base(object).intersect(&ray).map(|distance_m| ray.at(distance_m))
    };
    let seen = scene.surfaces.at_pixel(u, v).map(|(position_m, _)| position_m);
    let direction = (top_m(object) - seen.or_else(on_base)?).try_normalize()?;
    (direction.dot(scene.up()) > MIN_SINE).then_some(direction)
}

/// Returns the photo position of the shadow of an object's top in a sun's direction: on the first surface of the photo
/// that it falls on, or else on the plane of the object's base. `None` if the sun is at or below the horizon, or the
/// shadow falls behind the camera.
pub(crate) fn shadow_pixel(scene: &OpenScene, object: &Object, direction: Vec3) -> Option<[f64; 2]> {
    if direction.dot(scene.up()) < MIN_SINE {
        return None;
    }
    let camera = scene.estimate().frame.camera;
    let ray = Ray { origin: top_m(object), direction: -direction };
    let mut before: Option<f32> = None;
    for step in 1..=(REACH_M / STEP_M) as usize {
        let distance_m = STEP_M * step as f32;
        let point_m = ray.at(distance_m);
        let behind_m = camera.project(point_m).and_then(|(u, v, _)| {
            let (seen_m, _) = scene.surfaces.at_pixel(u, v)?;
            Some(seen_m.z - point_m.z)
        });
        // A point that is suddenly far behind a surface is hidden by it, not on it.
        if let (Some(before_m), Some(behind_m)) = (before, behind_m)
            && before_m <= 0.0
            && behind_m > 0.0
            && behind_m - before_m <= STEP_M + 2.0 * tolerance_m(scene, point_m)
        {
            let share = before_m / (before_m - behind_m);
            let (u, v, _) = camera.project(ray.at(distance_m - STEP_M * (1.0 - share)))?;
            return Some([u, v]);
        }
        before = behind_m;
    }
    let (u, v, _) = camera.project(ray.at(base(object).intersect(&ray)?))?;
    Some([u, v])
}
