//! Hole filling: surfaces are extrapolated into regions without depth readings, up to a limited distance.

use lo_geometry::{Plane, Ray, Vec3};
use lo_imaging::Image;

use crate::surface::observed_surfaces::SurfaceMap;

/// Reach of upward-facing surfaces into a hole, metres: floors and tables that reflect or absorb a sensor's light
/// continue.
const LEVEL_REACH_M: f32 = 1.0;

/// Reach of other surfaces into a hole, metres.
const OTHER_REACH_M: f32 = 0.15;

/// Smallest cosine of an upward-facing normal to the room's up.
const LEVEL_COSINE: f32 = 0.9;

/// Largest relative difference in depth within one surface.
const SAME_SURFACE: f32 = 0.02;

/// Range of extrapolated depths, as multiples of the reading's depth.
const DEPTH_RANGE: (f32, f32) = (0.5, 2.0);

/// Fills holes ring by ring with the planes of the readings at their edges. Where several meet, the farther one is
/// used, because sensors lose readings beside and behind an edge.
///
/// Returns the trust in each pixel: 1 at readings, falling smoothly to 0 at the end of the extrapolation. Pixels
/// beyond are not filled.
pub(crate) fn fill(map: &mut SurfaceMap, up: Vec3, floor: Option<Plane>) -> Image<f32> {
    let (width, height) = (map.width(), map.height());
    let mut trust = Image::from_fn(width, height, |x, y| if map.pixel(x, y).is_some() { 1.0 } else { 0.0 });
    // The reading that a pixel is extrapolated from; a reading refers to itself.
    let mut source: Vec<u32> = (0..width * height).map(|i| i as u32).collect();
    let mut ring: Vec<(usize, usize)> = holes_beside(&trust);
    while !ring.is_empty() {
        let mut filled = Vec::new();
        for &(x, y) in &ring {
            let candidates = around(x, y, width, height).filter(|&pixel| trust[pixel] > 0.0);
            let extrapolations: Vec<_> = candidates
                .filter_map(|(px, py)| {
                    let from = source[py * width + px];
                    Some((extrapolated(map, up, floor, from as usize, x, y)?, from))
                })
                .collect();
            let farthest_m = extrapolations.iter().map(|(surface, _)| surface.depth_m).fold(0.0, f32::max);
            let far =
                extrapolations.into_iter().filter(|(surface, _)| surface.depth_m > (1.0 - SAME_SURFACE) * farthest_m);
            let nearest = far.min_by(|(a, _), (b, _)| a.from_reading_m.total_cmp(&b.from_reading_m));
            filled.extend(nearest.map(|best| ((x, y), best)));
        }
        for &((x, y), (surface, from)) in &filled {
            map.depth_m[(x, y)] = surface.depth_m;
            map.normals[(x, y)] = surface.normal;
            trust[(x, y)] = surface.trust;
            source[y * width + x] = from;
        }
        ring =
            filled.iter().flat_map(|&((x, y), _)| around(x, y, width, height)).filter(|&p| trust[p] == 0.0).collect();
        ring.sort_unstable_by_key(|&(x, y)| (y, x));
        ring.dedup();
    }
    trust
}

/// A surface extrapolated into a hole.
#[derive(Clone, Copy)]
struct Extrapolation {
    depth_m: f32,
    normal: Vec3,
    trust: f32,
    from_reading_m: f32,
}

/// Extrapolates the plane of reading `from` to pixel `(x, y)`, within its reach.
fn extrapolated(
    map: &SurfaceMap,
    up: Vec3,
    floor: Option<Plane>,
    from: usize,
    x: usize,
    y: usize,
) -> Option<Extrapolation> {
    let reading = map.pixel(from % map.width(), from / map.width())?;
    let reading_m = -reading.position_m.z;
    let level = reading.normal.dot(up) > LEVEL_COSINE;
    let on_floor =
        |floor: &Plane| level && floor.signed_distance_m(reading.position_m).abs() < SAME_SURFACE * reading_m;
    let plane = floor.filter(on_floor).unwrap_or_else(|| Plane::through(reading.position_m, reading.normal));
    let ray = Ray { origin: Vec3::ZERO, direction: map.camera.direction(x as f64 + 0.5, y as f64 + 0.5) };
    let position_m = ray.at(plane.intersect(&ray)?);
    let depth_m = -position_m.z;
    if !(DEPTH_RANGE.0 * reading_m..DEPTH_RANGE.1 * reading_m).contains(&depth_m) {
        return None;
    }
    let reach_m = if level { LEVEL_REACH_M } else { OTHER_REACH_M };
    let from_reading_m = position_m.distance(reading.position_m);
    // Full trust for the first half.
    let t = (2.0 - 2.0 * from_reading_m / reach_m).min(1.0);
    (t > 0.0).then_some(Extrapolation { depth_m, normal: plane.normal, trust: t * t * (3.0 - 2.0 * t), from_reading_m })
}

fn holes_beside(trust: &Image<f32>) -> Vec<(usize, usize)> {
    let (width, height) = (trust.width(), trust.height());
    (0..width * height)
        .map(|i| (i % width, i / width))
        .filter(|&(x, y)| trust[(x, y)] == 0.0 && around(x, y, width, height).any(|pixel| trust[pixel] > 0.0))
        .collect()
}

/// Returns the up to eight neighbours of a pixel.
fn around(x: usize, y: usize, width: usize, height: usize) -> impl Iterator<Item = (usize, usize)> {
    let rows = y.saturating_sub(1)..(y + 2).min(height);
    rows.flat_map(move |py| (x.saturating_sub(1)..(x + 2).min(width)).map(move |px| (px, py)))
        .filter(move |&pixel| pixel != (x, y))
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use lo_geometry::Camera;

    use super::*;

    /// A floor 1 m below a camera pitched down by 45°, with holes where `hole` is true.
    fn floor_with(hole: impl Fn(usize, usize) -> bool) -> (SurfaceMap, Plane) {
        let camera = Camera::from_hfov_deg(60.0, 48, 36).unwrap();
        let normal = Vec3::new(0.0, 1.0, 1.0).normalize();
        let floor = Plane::through(-normal, normal);
        let depth_m = Image::from_fn(48, 36, |x, y| {
            let ray = Ray { origin: Vec3::ZERO, direction: camera.direction(x as f64 + 0.5, y as f64 + 0.5) };
            if hole(x, y) { 0.0 } else { -ray.at(floor.intersect(&ray).unwrap()).z }
        });
        let normals = Image::from_fn(48, 36, |x, y| if hole(x, y) { Vec3::ZERO } else { normal });
        (SurfaceMap { camera, depth_m, normals }, floor)
    }

    #[test]
    fn a_floor_goes_on_through_a_hole_and_fades() {
        let whole = floor_with(|_, _| false).0;
        let (mut map, floor) = floor_with(|x, _| x >= 20);
        let trust = fill(&mut map, floor.normal, Some(floor));
        for y in 0..36 {
            for x in 0..48 {
                let away_m = |from: usize| {
                    whole.pixel(x, y).unwrap().position_m.distance(whole.pixel(from, y).unwrap().position_m)
                };
                if trust[(x, y)] > 0.0 {
                    assert!((map.depth_m[(x, y)] / whole.depth_m[(x, y)] - 1.0).abs() < 1e-3, "({x}, {y})");
                }
                if x < 20 {
                    assert_eq!(trust[(x, y)], 1.0);
                } else {
                    let t = (2.0 - 2.0 * away_m(19)).min(1.0);
                    let expected = if t > 0.0 { t * t * (3.0 - 2.0 * t) } else { 0.0 };
                    assert!((trust[(x, y)] - expected).abs() < 0.05, "({x}, {y}): {} {expected}", trust[(x, y)]);
                }
            }
        }
        assert!(trust.pixels().contains(&0.0), "far from readings nothing is known");
    }

    #[test]
    fn what_does_not_face_up_ends_soon() {
        let (mut map, floor) = floor_with(|x, _| x >= 20);
        let trust = fill(&mut map, Vec3::X, None);
        let known = |trust: &Image<f32>| trust.pixels().iter().filter(|&&trust| trust > 0.0).count();
        let (mut level, _) = floor_with(|x, _| x >= 20);
        assert!(known(&trust) < known(&fill(&mut level, floor.normal, None)));
    }

    #[test]
    fn a_map_without_readings_stays_empty() {
        let (mut map, floor) = floor_with(|_, _| true);
        assert!(fill(&mut map, floor.normal, Some(floor)).pixels().iter().all(|&trust| trust == 0.0));
    }
}
