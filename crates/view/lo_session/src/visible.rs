//! Which faces of a room somebody in it sees. Estimated walls have holes and far sides; from outside, these would hide the room.

use std::sync::atomic::{AtomicBool, Ordering};

use lightoctree::geometry::{Camera, Ray, Vec3, fibonacci_sphere};
use lightoctree::mesh::PreparedModel;
use rayon::prelude::*;

/// Rays from the photo's camera all around, along the longer side of the photo, and from each other place all around.
const RAYS_AROUND: usize = 60_000;
const RAYS_ACROSS: usize = 320;
const RAYS_ELSEWHERE: usize = 16_000;

/// What is nearer to the camera stands in its own place, as a leaf may whose corner the camera is.
const TOO_NEAR_M: f32 = 0.2;

/// Places in the room beside the camera's: this far on the way to what is seen from there, no farther off than twice the median.
const PLACES: usize = 32;
const ON_THE_WAY: f32 = 0.6;
const TOO_FAR: f32 = 2.0;

/// How many faces far a surface goes on between the rays, and how small these are: of a share of their distance from the camera. Rays are 1/70 apart.
const GAPS: usize = 2;
const IN_GAPS: f32 = 1.0 / 16.0;

/// Of each face of a model that has two triangles a face, whether it is seen from the photo's camera at the origin or from places between it and what it sees;
/// and of small ones that lie beside one of these and look the same way. All, where nothing is seen.
pub(crate) fn visible(faces: &PreparedModel, quads: &[[u32; 4]], camera: &Camera) -> Vec<bool> {
    let is_seen: Vec<AtomicBool> = quads.iter().map(|_| AtomicBool::new(false)).collect();
    let send = |origin: Vec3, direction: Vec3| {
        let hit = faces.intersect(&Ray { origin, direction }, f32::INFINITY)?;
        is_seen[hit.triangle as usize / 2].store(true, Ordering::Relaxed);
        Some(hit.distance_m)
    };
    let from_camera =
        |direction: Vec3| send(direction * TOO_NEAR_M, direction).map(|distance_m| distance_m + TOO_NEAR_M);
    fibonacci_sphere(RAYS_AROUND).into_par_iter().for_each(|direction| {
        from_camera(direction);
    });
    let step = f64::from(camera.width.max(camera.height)) / RAYS_ACROSS as f64;
    let [columns, rows] = [camera.width, camera.height].map(|side| (f64::from(side) / step).ceil() as usize);
    (0..columns * rows).into_par_iter().for_each(|i| {
        let [u, v] = [i % columns, i / columns].map(|at| (at as f64 + 0.5) * step);
        from_camera(camera.direction(u, v));
    });
    let elsewhere = fibonacci_sphere(RAYS_ELSEWHERE);
    let mut ways: Vec<(Vec3, f32)> =
        fibonacci_sphere(PLACES).into_iter().filter_map(|way| Some((way, from_camera(way)?))).collect();
    ways.sort_by(|a, b| a.1.total_cmp(&b.1));
    let most_m = ways.get(ways.len() / 2).map_or(0.0, |(_, median_m)| TOO_FAR * median_m);
    for (way, distance_m) in ways.into_iter().filter(|(_, distance_m)| *distance_m <= most_m) {
        let place = way * (ON_THE_WAY * distance_m);
        elsewhere.par_iter().for_each(|&direction| {
            send(place, direction);
        });
    }
    let mut is_seen: Vec<bool> = is_seen.into_iter().map(AtomicBool::into_inner).collect();
    if !is_seen.contains(&true) {
        return vec![true; quads.len()];
    }
    let positions = &faces.model().positions;
    let sides: Vec<u8> = quads.iter().map(|&quad| side(quad.map(|corner| positions[corner as usize]))).collect();
    let mut looked = vec![0u8; positions.len()];
    for _ in 0..GAPS {
        for ((quad, side), _) in quads.iter().zip(&sides).zip(&is_seen).filter(|(_, is_seen)| **is_seen) {
            quad.iter().for_each(|&corner| looked[corner as usize] |= side);
        }
        for ((quad, side), is_seen) in quads.iter().zip(&sides).zip(&mut is_seen) {
            let [from, to] = [quad[0], quad[1]].map(|corner| positions[corner as usize]);
            let is_small = (to - from).length() < IN_GAPS * from.length();
            *is_seen |= is_small && quad.iter().any(|&corner| looked[corner as usize] & side != 0);
        }
    }
    is_seen
}

/// A bit for each of the six directions that a face can look to.
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
        // Before the camera, at it, and behind the one before it.
        let positions_m = [square(-2.0, 3.0), square(0.0, 0.1), square(-4.0, 1.0)].concat();
        let quads = [[0, 1, 2, 3], [4, 5, 6, 7], [8, 9, 10, 11]];
        let camera = Camera::from_hfov_deg(60.0, 64, 48).expect("a camera");
        assert_eq!(visible(&single_sided(&positions_m, &quads), &quads, &camera), [true, false, false]);
    }
}
