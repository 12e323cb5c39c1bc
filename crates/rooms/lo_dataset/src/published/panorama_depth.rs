//! Surfaces that a depth panorama shows.

use std::collections::VecDeque;

use lo_geometry::Vec3;
use lo_imaging::{DepthMap, RadianceImage, sample_equirectangular};

/// Distance from which a ray is traced: it starts on a surface, whose pixels lie on both sides of it.
const START_M: f32 = 0.05;

/// Step of a ray, as a share of the distance of its position from the camera, and at least, in metres.
const STEP: f32 = 0.02;
const MIN_STEP_M: f32 = 0.01;

/// A position that lies behind the shown surface by at most this is on it, in metres, plus this share of the distance.
/// Farther behind, it is hidden by the surface.
const THICKNESS_M: f32 = 0.05;
const THICKNESS: f32 = 0.05;

/// Length of a ray, in metres. Depth is at most 10 m.
const LENGTH_M: f32 = 25.0;

/// Fills pixels without distance (0) with that of the nearest pixel in the image.
///
/// Rows are closed circles. A map without any distance is returned unchanged.
pub(super) fn filled(distance_m: &DepthMap) -> DepthMap {
    let (width, height) = (distance_m.width(), distance_m.height());
    let mut filled = distance_m.clone();
    let all = (0..height).flat_map(|y| (0..width).map(move |x| (x, y)));
    let mut front: VecDeque<(usize, usize)> = all.filter(|&at| distance_m[at] > 0.0).collect();
    while let Some((x, y)) = front.pop_front() {
        let columns = [(x + 1) % width, (x + width - 1) % width].map(|x| (x, y));
        let rows = [y.checked_sub(1), Some(y + 1).filter(|&y| y < height)].into_iter().flatten().map(|y| (x, y));
        for next in columns.into_iter().chain(rows) {
            if filled[next] <= 0.0 {
                filled[next] = filled[(x, y)];
                front.push_back(next);
            }
        }
    }
    filled
}

/// Returns inverse distances, which are linear on a plane, nearly so in an equirectangular image, in the form that
/// [`traced_m`] interpolates.
pub(super) fn inverse(distance_m: &DepthMap) -> RadianceImage {
    distance_m.map(|distance_m| [1.0 / distance_m; 3])
}

/// Traces a ray from a position on a surface, relative to the camera, to the next surface that a panorama without holes
/// shows, by its [`inverse`] distances. Returns its distance from the position.
///
/// The position may be somewhat behind its own surface, as depth has the resolution of a pixel. Returns `None` if the
/// ray passes behind a surface: what is there is not shown.
pub(super) fn traced_m(inverse: &RadianceImage, origin: Vec3, direction: Vec3) -> Option<f32> {
    let behind_m = |t: f32| {
        let at = origin + t * direction;
        let distance_m = at.length();
        (distance_m - 1.0 / sample_equirectangular(inverse, at.normalize_or(Vec3::Y))[0], distance_m)
    };
    let mut in_front = None;
    let mut t = START_M;
    while t < LENGTH_M {
        let (behind, distance_m) = behind_m(t);
        if behind > THICKNESS_M + THICKNESS * distance_m {
            return None;
        }
        match in_front {
            _ if behind <= 0.0 => in_front = Some(t),
            Some(before) => return Some(bisected(&|t| behind_m(t).0 > 0.0, before, t)),
            None => {}
        }
        t += (STEP * distance_m).max(MIN_STEP_M);
    }
    None
}

/// Returns the smallest value at which `holds`, between one at which it does not and one at which it does.
fn bisected(holds: &dyn Fn(f32) -> bool, mut below: f32, mut above: f32) -> f32 {
    for _ in 0..8 {
        let middle = 0.5 * (below + above);
        if holds(middle) { above = middle } else { below = middle }
    }
    above
}

#[cfg(test)]
mod tests {
    use super::*;
    use lo_geometry::pixel_direction;

    /// Distance from the centre of a box with half sizes 2, 1.5 and 3 m to its walls.
    fn box_m(direction: Vec3) -> f32 {
        let d = direction.abs();
        (2.0 / d.x).min(1.5 / d.y).min(3.0 / d.z)
    }

    fn room(width: usize) -> DepthMap {
        DepthMap::from_fn(width, width / 2, |x, y| box_m(pixel_direction(x, y, width, width / 2)))
    }

    #[test]
    fn holes_get_the_nearest_distance_across_the_seam() {
        let mut map = DepthMap::from_fn(8, 4, |x, _| if x < 4 { 2.0 } else { 5.0 });
        map.pixels_mut().iter_mut().skip(8).take(16).enumerate().for_each(|(i, z)| {
            if [0, 1, 7].contains(&(i % 8)) {
                *z = 0.0;
            }
        });
        let filled = filled(&map);
        assert!(filled.pixels().iter().all(|&z| z == 2.0 || z == 5.0));
        // Row 1: column 1 is beside 2 m, column 7 beside 5 m; known pixels are unchanged.
        assert_eq!((filled[(1, 1)], filled[(7, 1)], filled[(3, 2)]), (2.0, 5.0, 2.0));
        let empty = DepthMap::from_fn(4, 2, |_, _| 0.0);
        assert_eq!(super::filled(&empty), empty);
    }

    #[test]
    fn rays_from_the_walls_of_a_box_end_on_the_other_walls() {
        let map = inverse(&room(512));
        let half = Vec3::new(2.0, 1.5, 3.0);
        let (mut count, mut worst) = (0, 0.0f32);
        for i in 0..400 {
            // Fibonacci directions, and origins on the floor and on a wall.
            let y = 1.0 - (2.0 * i as f32 + 1.0) / 400.0;
            let (sine, cosine) = (2.399_963 * i as f32).sin_cos();
            let direction = Vec3::new((1.0 - y * y).sqrt() * cosine, y, (1.0 - y * y).sqrt() * sine);
            for (origin, inward) in [(Vec3::new(0.4, -1.5, -1.2), Vec3::Y), (Vec3::new(2.0, 0.3, 0.5), Vec3::NEG_X)] {
                // Grazing rays end where pixels happen to lie.
                if direction.dot(inward) < 0.2 {
                    continue;
                }
                // By the slab method.
                let far = ((half * direction.signum() - origin) / direction).min_element();
                let found = traced_m(&map, origin, direction).expect("nothing is hidden in a box");
                worst = worst.max((found - far).abs());
                count += 1;
            }
        }
        // A pixel at 3.6 m is 4.4 cm wide.
        assert!(count > 250 && worst < 0.12, "{count} rays, {worst} m");
    }

    #[test]
    fn what_lies_behind_an_object_is_unknown() {
        // A column 1 m ahead, 20° wide, hides the wall at 3 m.
        let column = |direction: Vec3| direction.z < 0.0 && (direction.x / direction.z).abs() < 0.18;
        let map = DepthMap::from_fn(512, 256, |x, y| {
            let direction = pixel_direction(x, y, 512, 256);
            if column(direction) { 1.0 / direction.z.abs() } else { box_m(direction) }
        });
        let map = inverse(&map);
        // From the right side of the wall ahead to the left: behind the column.
        assert_eq!(traced_m(&map, Vec3::new(1.9, 0.0, -2.9), Vec3::NEG_X), None);
        // From behind the camera onto the column.
        let found = traced_m(&map, Vec3::new(0.0, 0.0, 3.0), Vec3::NEG_Z);
        assert!(found.is_some_and(|m| (m - 4.0).abs() < 0.05), "{found:?}");
    }
}
