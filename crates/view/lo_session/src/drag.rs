//! Dragging objects along the surfaces of the room.

use lo_geometry::{Plane, Ray, Vec3};

use crate::snap::{before_wall, held, is_hidden, level_continues, standing, tolerance_m};
use crate::{Object, ObjectPosition, OpenScene};

/// Maximum depth of a dragged object, as a multiple of the largest surface depth.
const MAX_DEPTH_FACTOR: f32 = 1.5;

/// Returns the position of a dragged object, so that the middle of its base projects to a photo position.
///
/// The object snaps to the surface seen there: it stands on floors, shelves and tables, in front of the walls behind
/// it, and touches walls and ceilings.
/// At depth edges and over gaps in the depth it keeps its height, unless the photo shows a surface in front of that
/// position. Lifted objects always keep their height. `None` if there is no such position.
pub(crate) fn dragged(scene: &OpenScene, object: &Object, is_lifted: bool, pixel: [f64; 2]) -> Option<ObjectPosition> {
    let from = object.placement;
    let camera = scene.estimate().frame.camera;
    if !camera.contains(pixel[0], pixel[1]) {
        return None;
    }
    let position = |point_m: Vec3| ObjectPosition::Position(point_m.to_array().map(f64::from));
    if !is_lifted {
        if let Some(rests) = standing(scene, object, pixel) {
            let rise_m = (rests.position_m - from.position_m).dot(from.up);
            if rise_m.abs() <= tolerance_m(scene, rests.position_m) || level_continues(scene, &rests, pixel) {
                return Some(ObjectPosition::Pixel(before_wall(scene, object, pixel)));
            }
        }
        if let Some(base_m) = held(scene, object, pixel) {
            return Some(position(base_m));
        }
    }
    let ray = Ray { origin: Vec3::ZERO, direction: camera.direction(pixel[0], pixel[1]) };
    let distance_m = Plane::through(from.position_m, from.up).intersect(&ray)?;
    let base_m = ray.at(distance_m);
    let is_far = -base_m.z >= MAX_DEPTH_FACTOR * scene.max_depth_m;
    (!is_far && !is_hidden(scene, base_m)).then(|| position(base_m))
}
