//! The surface below a wall's pixel, on which an object could stand instead.

use lo_geometry::Vec3;
use lo_scene::Estimate;

use crate::surface::observed_surfaces::SurfaceMap;

/// Distance from the wall, in metres: an object needs some room there.
const CLEARANCE_M: f32 = 0.15;

/// Step of the search downwards, and its length, in metres.
const STEP_M: f32 = 0.01;
const SEARCHED_M: f32 = 4.0;

/// Tolerated height of a reading over a point of the search: metres, and metres per metre of depth.
const TOLERANCE: (f32, f32) = (0.015, 0.01);

/// Returns the first surface below a point of a wall with this normal, and the pixel that shows it. If the photo shows
/// none, the floor plane. The cosine of the surface's tilt is at least `least_cosine`.
pub(crate) fn surface_below(
    scene: &Estimate,
    point: Vec3,
    normal: Vec3,
    least_cosine: f32,
) -> Option<(Vec3, Option<[f64; 2]>)> {
    let up = scene.up();
    let start = point + normal.reject_from_normalized(up).normalize_or_zero() * CLEARANCE_M;
    let camera = &scene.frame.camera;
    let steps = || (0..(SEARCHED_M / STEP_M) as usize).map(|step| start - up * (STEP_M * step as f32));
    let map = SurfaceMap::around(&scene.frame, &steps().collect::<Vec<_>>());
    let observed = steps().find_map(|below| {
        let (u, v, _) = camera.project(below)?;
        // The middle of the pixel, which a user can give.
        let [u, v] = [u.floor() + 0.5, v.floor() + 0.5];
        let surface = map.at(u / f64::from(camera.width), v / f64::from(camera.height))?;
        let height_m = (surface.position_m - below).dot(up).abs();
        let is_there = height_m < TOLERANCE.0 - TOLERANCE.1 * surface.position_m.z;
        (is_there && surface.normal.dot(up) > least_cosine).then_some((surface.position_m, Some([u, v])))
    });
    let floor = || Some((scene.room.as_ref()?.floor()?.project(start), None));
    observed.or_else(floor)
}
