//! Contact of an object's base with the observed surface.

use lo_geometry::{Camera, Vec3};

use crate::surface::occluders::Occluders;

/// Step of the search along the vertical, in metres.
const STEP_M: f32 = 0.01;

/// Length of the search downwards, in metres.
const DOWN_M: f32 = 3.0;

/// Smallest cosine between the up direction and the normal of a surface that supports objects.
const LEAST_COSINE: f32 = 0.7;

/// Largest distance between a point and its reading, as a share of the depth, in addition to [`NEAR_M`].
const NEAR_SHARE: f32 = 0.05;
const NEAR_M: f32 = 0.05;

/// Returns the height in metres of the observed surface straight below or above a point, relative to the point.
///
/// The nearest one counts, up to 3 m below and `rise_m` above. `None` if the photo shows none.
pub(crate) fn surface_height_m(
    occluders: &Occluders,
    camera: &Camera,
    point: Vec3,
    up: Vec3,
    rise_m: f32,
) -> Option<f32> {
    let steps = (DOWN_M.max(rise_m) / STEP_M) as i32;
    let offsets_m = (0..=steps).flat_map(|step| [-step, step].map(|step| STEP_M * step as f32));
    offsets_m.filter(|&offset_m| offset_m >= -DOWN_M && offset_m <= rise_m).find_map(|offset_m| {
        let tested = point + up * offset_m;
        let (u, v, _) = camera.project(tested)?;
        let surface = occluders.at(u / f64::from(camera.width), v / f64::from(camera.height))?;
        let depth_m = -surface.position_m.z;
        let between = surface.position_m - tested;
        let height_m = between.dot(up);
        let is_there = height_m.abs() < STEP_M + occluders.bias_m(depth_m)
            && between.length() < NEAR_M + NEAR_SHARE * depth_m
            && surface.normal.dot(up) > LEAST_COSINE;
        is_there.then_some(offset_m + height_m)
    })
}
