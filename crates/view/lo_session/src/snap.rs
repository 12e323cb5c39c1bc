//! Surfaces that hold objects: floors, shelves and tables carry them, walls and ceilings stop them.

use lo_geometry::{Plane, Quat, Ray, Vec3};
use lo_insert::Placement;

use crate::{Object, ObjectPosition, OpenScene};

/// Height difference up to which two surfaces count as the same level: metres, and metres per metre of depth. For
/// measured and for predicted depth. Equal to the tolerance of `Placement::settled`.
const LEVEL_TOLERANCE: [(f32, f32); 2] = [(0.02, 0.01), (0.04, 0.04)];

/// Positions around a pixel at which a surface is tested, and how many must be on it.
const SAMPLES: usize = 8;
const MIN_SAMPLES: usize = 6;

/// Radius of the circle of these positions, as a share of the photo's longer side. Shelves are barely wider.
const SAMPLE_RADIUS: f64 = 0.012;

/// Maximum slope of a supporting surface, degrees.
const MAX_SLOPE_DEG: f32 = 40.0;

/// Search for a place in front of a wall: shares of the object's height that are tested, and step, metres.
const WALL_HEIGHTS: [f32; 3] = [0.3, 0.5, 0.7];
const WALL_STEP_M: f32 = 0.01;

/// Search for a surface below an object: height above its base at the start, step, and length, metres.
const FALL_FROM_M: f32 = 0.02;
const FALL_STEP_M: f32 = 0.01;
const FALL_M: f32 = 6.0;

/// Returns the placement on the surface seen at a pixel, if it can support the object.
pub(crate) fn standing(scene: &OpenScene, object: &Object, pixel: [f64; 2]) -> Option<Placement> {
    let (_, normal) = scene.surfaces.at_pixel(pixel[0], pixel[1])?;
    if !is_supporting(scene, normal) {
        return None;
    }
    let moved = Object { position: ObjectPosition::Pixel(pixel), path: None, ..object.clone() };
    let placement = moved.placed(scene.ground(), 0.0).ok()?.placement;
    placement.support.is_some().then_some(placement)
}

/// Returns the nearest pixel towards the camera at which an object stands on the same level and does not reach into a
/// wall behind it, such as the back of a shelf. The same pixel if it does not there, or there is no such place nearby.
pub(crate) fn before_wall(scene: &OpenScene, object: &Object, pixel: [f64; 2]) -> [f64; 2] {
    let Some(rests) = standing(scene, object, pixel) else { return pixel };
    let up = rests.up;
    let Some(away) = rests.position_m.reject_from(up).try_normalize() else { return pixel };
    let size_m = object.mesh.size() * rests.scale;
    let reach_m = reach_m(&Object { placement: rests, ..object.clone() }, away);
    let reaches_into_wall = |base_m: Vec3| {
        WALL_HEIGHTS.iter().any(|share| {
            let middle_m = base_m + up * (share * size_m.y);
            // What hides the middle, too, is not behind the object but in front of it.
            is_hidden(scene, middle_m + away * reach_m) && !is_hidden(scene, middle_m)
        })
    };
    let steps = (2.0 * reach_m / WALL_STEP_M) as usize;
    let clear = (0..=steps).map(|step| rests.position_m - away * (WALL_STEP_M * step as f32));
    let Some(clear_m) = clear.into_iter().find(|base_m| !reaches_into_wall(*base_m)) else { return pixel };
    let Some((u, v, _)) = scene.estimate().frame.camera.project(clear_m) else { return pixel };
    let is_level =
        |moved: Placement| (moved.position_m - rests.position_m).dot(up).abs() <= tolerance_m(scene, clear_m);
    if clear_m != rests.position_m && standing(scene, object, [u, v]).is_some_and(is_level) { [u, v] } else { pixel }
}

/// Returns whether the level of a placement continues around its pixel, so that the pixel is not at a depth edge.
pub(crate) fn level_continues(scene: &OpenScene, rests: &Placement, pixel: [f64; 2]) -> bool {
    let same_level = |(position_m, normal): &(Vec3, Vec3)| {
        let rise_m = (*position_m - rests.position_m).dot(rests.up);
        is_supporting(scene, *normal) && rise_m.abs() <= tolerance_m(scene, *position_m)
    };
    around(scene, pixel).filter(same_level).count() >= MIN_SAMPLES
}

/// Returns the position of the base at which an object touches the wall or ceiling seen at a pixel, and projects to the
/// pixel. `None` if there is none, or it does not continue around the pixel.
pub(crate) fn held(scene: &OpenScene, object: &Object, pixel: [f64; 2]) -> Option<Vec3> {
    let wall = wall_at(scene, pixel)?;
    let camera = scene.estimate().frame.camera;
    let ray = Ray { origin: Vec3::ZERO, direction: camera.direction(pixel[0], pixel[1]) };
    let before_wall = Plane { offset_m: wall.offset_m + reach_m(object, wall.normal), ..wall };
    before_wall.intersect(&ray).map(|distance_m| ray.at(distance_m))
}

/// Returns whether an object touches the wall or ceiling that the photo shows at its base.
pub(crate) fn is_held(scene: &OpenScene, object: &Object) -> bool {
    let base_m = object.placement.position_m;
    let Some((u, v, _)) = scene.estimate().frame.camera.project(base_m) else { return false };
    wall_at(scene, [u, v]).is_some_and(|wall| {
        let gap_m = wall.signed_distance_m(base_m) - reach_m(object, wall.normal);
        gap_m.abs() <= 2.0 * tolerance_m(scene, base_m)
    })
}

/// Returns whether a point is hidden by the surface that the photo shows in front of it.
pub(crate) fn is_hidden(scene: &OpenScene, point_m: Vec3) -> bool {
    let Some((u, v, _)) = scene.estimate().frame.camera.project(point_m) else { return false };
    let seen = scene.surfaces.at_pixel(u, v);
    seen.is_some_and(|(seen_m, _)| -point_m.z > -seen_m.z + 2.0 * tolerance_m(scene, seen_m))
}

/// Returns the position of an object after it has fallen along gravity: on the first supporting surface that the photo
/// shows below it, or else on the floor. `None` if neither is below it.
pub(crate) fn fallen(scene: &OpenScene, object: &Object) -> Option<ObjectPosition> {
    let (camera, up) = (scene.estimate().frame.camera, scene.up());
    let from_m = object.placement.position_m + up * FALL_FROM_M;
    let mut nearest: Option<(f32, [f64; 2])> = None;
    for step in 0..(FALL_M / FALL_STEP_M) as usize {
        let below_m = from_m - up * (FALL_STEP_M * step as f32);
        let surface = camera
            .project(below_m)
            .and_then(|(u, v, _)| Some((scene.surfaces.at_pixel(u, v)?, [u, v])))
            .filter(|((position_m, normal), _)| {
                let height_m = (*position_m - below_m).dot(up).abs();
                is_supporting(scene, *normal) && height_m <= tolerance_m(scene, *position_m)
            });
        match (surface, nearest) {
            (Some(((position_m, _), pixel)), _) => {
                let height_m = (position_m - below_m).dot(up).abs();
                if nearest.is_none_or(|(least_m, _)| height_m < least_m) {
                    nearest = Some((height_m, pixel));
                }
            }
            // The first surface is passed.
            (None, Some(_)) => break,
            (None, None) => {}
        }
    }
    if let Some((_, pixel)) = nearest
        && standing(scene, object, pixel).is_some()
    {
        return Some(ObjectPosition::Pixel(pixel));
    }
    let floor = scene.estimate().room.as_ref()?.floor()?;
    let fall = Ray { origin: from_m, direction: -up };
    let distance_m = floor.intersect(&fall)?;
    Some(ObjectPosition::Position(fall.at(distance_m).to_array().map(f64::from)))
}

/// Returns the tolerance of heights and distances at a point, metres.
pub(crate) fn tolerance_m(scene: &OpenScene, at: Vec3) -> f32 {
    let (least_m, per_m) = LEVEL_TOLERANCE[usize::from(scene.estimate().origin.predicted_depth)];
    least_m + per_m * -at.z
}

/// Returns the plane of the wall or ceiling seen at a pixel, with its normal towards the camera. `None` if the surface
/// supports objects, or does not continue around the pixel.
fn wall_at(scene: &OpenScene, pixel: [f64; 2]) -> Option<Plane> {
    let (centre_m, normal) = scene.surfaces.at_pixel(pixel[0], pixel[1])?;
    let plane = Plane::through(centre_m, normal);
    let is_on_it = |(position_m, normal): &(Vec3, Vec3)| {
        !is_supporting(scene, *normal)
            && normal.dot(plane.normal) > 0.7
            && plane.signed_distance_m(*position_m).abs() <= tolerance_m(scene, centre_m)
    };
    if is_supporting(scene, normal) {
        return None;
    }
    let on_it: Vec<_> = around(scene, pixel).filter(is_on_it).collect();
    let mean = on_it.iter().map(|(_, normal)| *normal).sum::<Vec3>() + normal;
    (on_it.len() >= MIN_SAMPLES).then(|| Plane::through(centre_m, mean.normalize_or(normal)))
}

/// Returns the surfaces seen around a pixel, on a circle that is foreshortened like one on the floor.
fn around(scene: &OpenScene, [u, v]: [f64; 2]) -> impl Iterator<Item = (Vec3, Vec3)> {
    let camera = scene.estimate().frame.camera;
    let radius = SAMPLE_RADIUS * f64::from(camera.width.max(camera.height));
    (0..SAMPLES).filter_map(move |index| {
        let (sin, cos) = (std::f64::consts::TAU * index as f64 / SAMPLES as f64).sin_cos();
        scene.surfaces.at_pixel(u + radius * cos, v + 0.5 * radius * sin)
    })
}

fn is_supporting(scene: &OpenScene, normal: Vec3) -> bool {
    normal.dot(scene.up()) > MAX_SLOPE_DEG.to_radians().cos()
}

/// Returns the distance of an object's base from a plane of a normal that the object's bounding box touches, metres.
fn reach_m(object: &Object, normal: Vec3) -> f32 {
    let Placement { scale, up, yaw_rad, .. } = object.placement;
    let local = (Quat::from_rotation_arc(Vec3::Y, up) * Quat::from_rotation_y(yaw_rad)).conjugate() * normal;
    let size_m = object.mesh.size() * scale;
    0.5 * (local.x.abs() * size_m.x + local.z.abs() * size_m.z) + (-local.y).max(0.0) * size_m.y
}
