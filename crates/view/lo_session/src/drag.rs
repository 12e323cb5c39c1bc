//! Where an object goes that is dragged through the photo.

use lightoctree::geometry::{Plane, Ray, Vec3};
use lightoctree::insert::Placement;

use crate::{Object, OpenScene, Place};

/// Surfaces this far above or below where the object stands are the one that it stands on: metres, and metres per metre of depth, for measured and for
/// predicted depth. It is what `Placement::settled` takes for one surface.
const LEVEL_REACH: [(f32, f32); 2] = [(0.02, 0.01), (0.04, 0.04)];

/// Places around the pointer at which another level must go on before the object changes to it, and how many of them must agree.
const AROUND: usize = 8;
const AGREE: usize = 6;

/// Radius of that circle at least, as a share of the photo's longer side.
const MIN_RADIUS: f64 = 0.012;

/// Surfaces steeper than this carry nothing, degrees.
const STEEPEST_DEG: f32 = 40.0;

/// Farther than this many times the farthest surface nothing is dragged.
const FARTHEST: f32 = 1.5;

/// Where the object goes whose base's middle shall be seen at a photo position: along the surface that it stands on; where that has a gap, at the same height;
/// onto another level only where that goes on around the place, so that it does not jump at depth edges. Lifted objects stay as high as they are. `None`
/// where it cannot go.
pub fn dragged(open: &OpenScene, object: &Object, is_lifted: bool, [u, v]: [f64; 2]) -> Option<Place> {
    let from = object.placement;
    let camera = open.estimate().frame.camera;
    if !camera.contains(u, v) {
        return None;
    }
    if !is_lifted && let Some(rests) = resting(open, object, [u, v]) {
        let rise_m = (rests.position_m - from.position_m).dot(from.up);
        if rise_m.abs() <= level_reach_m(open, rests.position_m) || goes_on(open, object, &rests, [u, v]) {
            return Some(Place::Pixel([u, v]));
        }
    }
    let ray = Ray { origin: Vec3::ZERO, direction: camera.direction(u, v) };
    let distance_m = Plane::through(from.position_m, from.up).intersect(&ray).filter(|distance_m| *distance_m > 0.0)?;
    let place = ray.at(distance_m);
    (-place.z < FARTHEST * open.far_m).then(|| Place::Position(place.to_array().map(f64::from)))
}

/// How the object would stand on what is seen there, if it can.
fn resting(open: &OpenScene, object: &Object, pixel: [f64; 2]) -> Option<Placement> {
    let (_, normal) = open.surfaces.at_pixel(pixel[0], pixel[1])?;
    if !carries(open, normal) {
        return None;
    }
    let moved = Object { place: Place::Pixel(pixel), path: None, ..object.clone() };
    moved.placed(open.ground(), 0.0).ok().map(|object| object.placement).filter(|placement| placement.support.is_some())
}

fn carries(open: &OpenScene, normal: Vec3) -> bool {
    normal.dot(open.up()) > STEEPEST_DEG.to_radians().cos()
}

fn level_reach_m(open: &OpenScene, at: Vec3) -> f32 {
    let (least_m, per_m) = LEVEL_REACH[usize::from(open.estimate().origin.predicted_depth)];
    least_m + per_m * -at.z
}

/// Whether the level of a placement goes on around it as far as the object reaches.
fn goes_on(open: &OpenScene, object: &Object, rests: &Placement, [u, v]: [f64; 2]) -> bool {
    let camera = open.estimate().frame.camera;
    let size = object.mesh.size();
    let reach_m = 0.5 * f64::from(size.x.max(size.z) * rests.scale);
    let longer = f64::from(camera.width.max(camera.height));
    let radius = (camera.fx * reach_m / f64::from(-rests.position_m.z)).clamp(MIN_RADIUS * longer, 0.1 * longer);
    let same_level = |index: usize| {
        let (sin, cos) = (std::f64::consts::TAU * index as f64 / AROUND as f64).sin_cos();
        // A circle on the floor looks flat.
        let Some((position_m, normal)) = open.surfaces.at_pixel(u + radius * cos, v + 0.5 * radius * sin) else {
            return false;
        };
        let rise_m = (position_m - rests.position_m).dot(rests.up);
        carries(open, normal) && rise_m.abs() <= level_reach_m(open, position_m)
    };
    (0..AROUND).filter(|&index| same_level(index)).count() >= AGREE
}
