//! Dragging objects along their supporting surfaces.

use lo_geometry::{Plane, Ray, Vec3};
use lo_insert::Placement;

use crate::{Object, ObjectPosition, OpenScene};

/// Height difference up to which two surfaces count as the same level: metres, and metres per metre of depth. For
/// measured and for predicted depth. Equal to the tolerance of `Placement::settled`.
const LEVEL_TOLERANCE: [(f32, f32); 2] = [(0.02, 0.01), (0.04, 0.04)];

/// Positions around the pointer at which another level is tested, and how many must be on it before the object changes
/// to it.
const LEVEL_SAMPLES: usize = 8;
const MIN_LEVEL_SAMPLES: usize = 6;

/// Minimum radius of the circle of these positions, as a share of the photo's longer side.
const MIN_RADIUS: f64 = 0.012;

/// Maximum slope of a supporting surface, degrees.
const MAX_SLOPE_DEG: f32 = 40.0;

/// Maximum depth of a dragged object, as a multiple of the largest surface depth.
const MAX_DEPTH_FACTOR: f32 = 1.5;

/// Returns the position of a dragged object, so that the middle of its base projects to a photo position.
///
/// The object follows its supporting surface and keeps its height across gaps. It changes to another level only where
/// that continues around the position, so it does not jump at depth edges. Lifted objects keep their height. `None` if
/// there is no such position.
pub fn dragged(scene: &OpenScene, object: &Object, is_lifted: bool, [u, v]: [f64; 2]) -> Option<ObjectPosition> {
    let from = object.placement;
    let camera = scene.estimate().frame.camera;
    if !camera.contains(u, v) {
        return None;
    }
    if !is_lifted && let Some(rests) = settled(scene, object, [u, v]) {
        let rise_m = (rests.position_m - from.position_m).dot(from.up);
        if rise_m.abs() <= level_tolerance_m(scene, rests.position_m) || level_continues(scene, object, &rests, [u, v])
        {
            return Some(ObjectPosition::Pixel([u, v]));
        }
    }
    let ray = Ray { origin: Vec3::ZERO, direction: camera.direction(u, v) };
    let distance_m = Plane::through(from.position_m, from.up).intersect(&ray).filter(|distance_m| *distance_m > 0.0)?;
    let position = ray.at(distance_m);
    (-position.z < MAX_DEPTH_FACTOR * scene.max_depth_m)
        .then(|| ObjectPosition::Position(position.to_array().map(f64::from)))
}

/// Returns the placement on the surface seen at a pixel, if it can support the object.
fn settled(scene: &OpenScene, object: &Object, pixel: [f64; 2]) -> Option<Placement> {
    let (_, normal) = scene.surfaces.at_pixel(pixel[0], pixel[1])?;
    if !is_supporting(scene, normal) {
        return None;
    }
    let moved = Object { position: ObjectPosition::Pixel(pixel), path: None, ..object.clone() };
    moved
        .placed(scene.ground(), 0.0)
        .ok()
        .map(|object| object.placement)
        .filter(|placement| placement.support.is_some())
}

fn is_supporting(scene: &OpenScene, normal: Vec3) -> bool {
    normal.dot(scene.up()) > MAX_SLOPE_DEG.to_radians().cos()
}

fn level_tolerance_m(scene: &OpenScene, at: Vec3) -> f32 {
    let (least_m, per_m) = LEVEL_TOLERANCE[usize::from(scene.estimate().origin.predicted_depth)];
    least_m + per_m * -at.z
}

/// Returns whether the level of a placement continues around it as far as the object extends.
fn level_continues(scene: &OpenScene, object: &Object, rests: &Placement, [u, v]: [f64; 2]) -> bool {
    let camera = scene.estimate().frame.camera;
    let size = object.mesh.size();
    let reach_m = 0.5 * f64::from(size.x.max(size.z) * rests.scale);
    let longer = f64::from(camera.width.max(camera.height));
    let radius = (camera.fx * reach_m / f64::from(-rests.position_m.z)).clamp(MIN_RADIUS * longer, 0.1 * longer);
    let same_level = |index: usize| {
        let (sin, cos) = (std::f64::consts::TAU * index as f64 / LEVEL_SAMPLES as f64).sin_cos();
        // A circle on the floor is foreshortened in the image.
        let Some((position_m, normal)) = scene.surfaces.at_pixel(u + radius * cos, v + 0.5 * radius * sin) else {
            return false;
        };
        let rise_m = (position_m - rests.position_m).dot(rests.up);
        is_supporting(scene, normal) && rise_m.abs() <= level_tolerance_m(scene, position_m)
    };
    (0..LEVEL_SAMPLES).filter(|&index| same_level(index)).count() >= MIN_LEVEL_SAMPLES
}
