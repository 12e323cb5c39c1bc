//! Visibility of a room's faces from inside. Estimated walls have holes and far sides, which would hide the room in a
//! view from outside.

use std::sync::atomic::{AtomicBool, Ordering};

use lo_geometry::{Camera, Ray, Vec3, fibonacci_sphere};
use lo_mesh::PreparedModel;
use rayon::prelude::*;

/// Rays over the sphere from the photo's camera, along the photo's longer side, and over the sphere from each other
/// viewpoint.
const CAMERA_SPHERE_RAYS: usize = 60_000;
const PHOTO_RAYS_ACROSS: usize = 320;
const VIEWPOINT_RAYS: usize = 16_000;

/// Nearer faces are skipped: the camera may be at the corner of a leaf.
const MIN_DISTANCE_M: f32 = 0.2;

/// Number of further viewpoints, each at a share of the distance from the camera to what it sees in a direction.
/// Directions whose distance exceeds this multiple of the median are skipped.
const VIEWPOINTS: usize = 32;
const VIEWPOINT_SHARE: f32 = 0.6;
const MAX_MEDIAN_FACTOR: f32 = 2.0;

/// Gaps between rays are filled by this many rings of neighbours with edges below a share of their distance from the
/// camera. Rays are 1/70 apart.
const FILL_RINGS: usize = 2;
const MAX_FILL_EDGE: f32 = 1.0 / 16.0;

/// Returns for each quad of a model with two triangles per quad whether it is visible from inside the room.
///
/// Viewpoints are the photo's camera at the origin, and points between it and what it sees. Small neighbours of visible
/// faces with the same orientation count as visible. If nothing is visible, all faces are.
pub(crate) fn visible_faces(faces: &PreparedModel, quads: &[[u32; 4]], camera: &Camera) -> Vec<bool> {
    let is_seen: Vec<AtomicBool> = quads.iter().map(|_| AtomicBool::new(false)).collect();
    let send = |origin: Vec3, direction: Vec3| {
        let hit = faces.intersect(&Ray { origin, direction }, f32::INFINITY)?;
        is_seen[hit.triangle as usize / 2].store(true, Ordering::Relaxed);
        Some(hit.distance_m)
    };
    let from_camera =
        |direction: Vec3| send(direction * MIN_DISTANCE_M, direction).map(|distance_m| distance_m + MIN_DISTANCE_M);
    fibonacci_sphere(CAMERA_SPHERE_RAYS).into_par_iter().for_each(|direction| {
        from_camera(direction);
    });
    let step = f64::from(camera.width.max(camera.height)) / PHOTO_RAYS_ACROSS as f64;
    let [columns, rows] = [camera.width, camera.height].map(|side| (f64::from(side) / step).ceil() as usize);
    (0..columns * rows).into_par_iter().for_each(|i| {
        let [u, v] = [i % columns, i / columns].map(|at| (at as f64 + 0.5) * step);
        from_camera(camera.direction(u, v));
    });
    let elsewhere = fibonacci_sphere(VIEWPOINT_RAYS);
    let mut ways: Vec<(Vec3, f32)> =
        fibonacci_sphere(VIEWPOINTS).into_iter().filter_map(|way| Some((way, from_camera(way)?))).collect();
    ways.sort_by(|a, b| a.1.total_cmp(&b.1));
    let max_m = ways.get(ways.len() / 2).map_or(0.0, |(_, median_m)| MAX_MEDIAN_FACTOR * median_m);
    for (way, distance_m) in ways.into_iter().filter(|(_, distance_m)| *distance_m <= max_m) {
        let viewpoint = way * (VIEWPOINT_SHARE * distance_m);
        elsewhere.par_iter().for_each(|&direction| {
            send(viewpoint, direction);
        });
    }
    let mut is_seen: Vec<bool> = is_seen.into_iter().map(AtomicBool::into_inner).collect();
    if !is_seen.contains(&true) {
        return vec![true; quads.len()];
    }
    let positions = &faces.model().positions;
    let sides: Vec<u8> = quads.iter().map(|&quad| side(quad.map(|corner| positions[corner as usize]))).collect();
    let mut visible_sides = vec![0u8; positions.len()];
    for _ in 0..FILL_RINGS {
        for ((quad, side), _) in quads.iter().zip(&sides).zip(&is_seen).filter(|(_, is_seen)| **is_seen) {
            quad.iter().for_each(|&corner| visible_sides[corner as usize] |= side);
        }
        for ((quad, side), is_seen) in quads.iter().zip(&sides).zip(&mut is_seen) {
            let [from, to] = [quad[0], quad[1]].map(|corner| positions[corner as usize]);
            let is_small = (to - from).length() < MAX_FILL_EDGE * from.length();
            *is_seen |= is_small && quad.iter().any(|&corner| visible_sides[corner as usize] & side != 0);
        }
    }
    is_seen
}

/// Returns a bit for the direction of a face, one of six.
fn side([a, b, c, _]: [Vec3; 4]) -> u8 {
    let normal = (b - a).cross(c - a);
    let axis = (0..3).max_by(|&i, &j| normal[i].abs().total_cmp(&normal[j].abs())).unwrap_or(0);
    1 << (2 * axis + usize::from(normal[axis] > 0.0))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::outside::single_sided;

    #[test]
    fn a_leaf_whose_corner_is_the_camera_hides_nothing() {
        let square = |z: f32, half: f32| {
            [[-half, -half], [half, -half], [half, half], [-half, half]].map(|[x, y]| Vec3::new(x, y, z))
        };
        // In front of the camera, at the camera, and behind the first one.
        let positions_m = [square(-2.0, 3.0), square(0.0, 0.1), square(-4.0, 1.0)].concat();
        let quads = [[0, 1, 2, 3], [4, 5, 6, 7], [8, 9, 10, 11]];
        let camera = Camera::from_hfov_deg(60.0, 64, 48).expect("a camera");
        assert_eq!(visible_faces(&single_sided(&positions_m, &quads), &quads, &camera), [true, false, false]);
    }
}
