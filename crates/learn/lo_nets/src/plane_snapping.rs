//! Plane snapping: moves near-planar parts of predicted depth onto planes.
//!
//! Planes are found in inverse depth, where they are linear: `1 / z = p · ray`. RANSAC (Fischler and Bolles 1981) finds
//! one after another, the largest first. Pixels near a plane with a similar normal are moved onto it.

use lo_geometry::{Camera, DMat3, DVec3, Vec3};
use lo_imaging::{DepthMap, Image};
use lo_random::{RngExt, Stream};
use rayon::prelude::*;

/// Pixels between neighbouring samples that planes are fitted to.
const SAMPLE_STRIDE: usize = 4;

/// Radius, in pixels, of the neighbourhood that a pixel's normal is fitted to.
const NORMAL_RADIUS: usize = 6;

/// Maximum number of planes, and minimum share of the samples that are a plane's inliers.
const MAX_PLANES: usize = 6;
const MIN_INLIER_SHARE: f32 = 0.05;

/// RANSAC hypotheses for each plane. The one with the most inliers is kept.
const HYPOTHESES: usize = 600;

/// Distances from a plane, relative to depth: limit for inlier samples, and limit for snapping. Between the two, a
/// pixel moves only part of the way.
const INLIER_TOLERANCE: f32 = 0.03;
const SNAP_TOLERANCE: f32 = 0.06;

/// Cosines between a pixel's and a plane's normal. Snapping begins at the first and is complete at the second, which is
/// also the limit for inliers.
const NORMAL_COSINES: [f32; 2] = [0.7, 0.85];

/// Least-squares refinements on a plane's inliers.
const REFINEMENTS: usize = 3;

/// Snaps near-planar depth to planes.
///
/// Depth accuracy hardly changes (`docs/design/046-flat-where-nearly-flat.md`). Shadows and reflections on floors and
/// mirrors improve.
pub(crate) fn snap_to_planes(depth_m: &DepthMap, camera: &Camera) -> DepthMap {
    let (width, height) = (depth_m.width(), depth_m.height());
    let camera = camera.resized(width as u32, height as u32);
    let ray = |x: usize, y: usize| camera.unproject(x as f64 + 0.5, y as f64 + 0.5, 1.0);
    let (columns, rows) = (width.div_ceil(SAMPLE_STRIDE), height.div_ceil(SAMPLE_STRIDE));
    let samples: Vec<Sample> = (0..columns * rows)
        .into_par_iter()
        .map(|i| {
            let (x, y) = (i % columns * SAMPLE_STRIDE, i / columns * SAMPLE_STRIDE);
            Sample { ray: ray(x, y), inverse: 1.0 / depth_m[(x, y)], normal: fitted_normal(depth_m, x, y, ray) }
        })
        .collect();
    let samples = Image::new(columns, rows, samples);
    let planes = planes(&samples);
    let rows = (0..height).into_par_iter().flat_map_iter(|y| {
        let (planes, samples) = (&planes, &samples);
        (0..width).map(move |x| {
            let (ray, inverse) = (ray(x, y), 1.0 / depth_m[(x, y)]);
            let own = Sample { ray, inverse, ..samples[(x / SAMPLE_STRIDE, y / SAMPLE_STRIDE)] };
            let (mut sum, mut total) = (0.0, 0.0);
            for &plane in planes {
                let weight = own.snap_weight(plane);
                sum += weight * plane.dot(ray);
                total += weight;
            }
            f32::max(total, 1.0) / (sum + f32::max(1.0 - total, 0.0) * inverse)
        })
    });
    DepthMap::new(width, height, rows.collect())
}

/// A pixel with its inverse depth, and the normal of the depth around it.
#[derive(Clone, Copy, Debug)]
struct Sample {
    ray: Vec3,
    inverse: f32,
    /// Unit normal, pointing away from the camera.
    normal: Vec3,
}

impl Sample {
    /// Returns the distance from a plane along the ray, relative to depth.
    fn relative_error(&self, plane: Vec3) -> f32 {
        (plane.dot(self.ray) / self.inverse - 1.0).abs()
    }

    fn is_inlier(&self, plane: Vec3) -> bool {
        self.relative_error(plane) < INLIER_TOLERANCE && self.normal.dot(plane) > NORMAL_COSINES[1] * plane.length()
    }

    /// Returns how far the sample moves onto a plane: 0 not at all, 1 completely.
    fn snap_weight(&self, plane: Vec3) -> f32 {
        let near = (SNAP_TOLERANCE - self.relative_error(plane)) / (SNAP_TOLERANCE - INLIER_TOLERANCE);
        let faces = (self.normal.dot(plane.normalize()) - NORMAL_COSINES[0]) / (NORMAL_COSINES[1] - NORMAL_COSINES[0]);
        near.clamp(0.0, 1.0) * faces.clamp(0.0, 1.0)
    }
}

/// Returns the unit normal of the plane fitted to inverse depth around a pixel, pointing away from the camera.
fn fitted_normal(depth_m: &DepthMap, x: usize, y: usize, ray: impl Fn(usize, usize) -> Vec3) -> Vec3 {
    let near = |at: usize, size: usize| at.saturating_sub(NORMAL_RADIUS)..(at + NORMAL_RADIUS + 1).min(size);
    let pixels = near(y, depth_m.height()).flat_map(|y| near(x, depth_m.width()).map(move |x| (x, y)));
    let fitted = fit_plane(pixels.map(|(x, y)| (ray(x, y), 1.0 / depth_m[(x, y)])));
    fitted.and_then(Vec3::try_normalize).unwrap_or(-Vec3::Z)
}

/// Fits a plane to rays with inverse depths by least squares of the relative depth error. Returns `None` for collinear
/// points.
fn fit_plane(points: impl Iterator<Item = (Vec3, f32)>) -> Option<Vec3> {
    let (mut squares, mut sum) = (DMat3::ZERO, DVec3::ZERO);
    for (ray, inverse) in points {
        let row = ray.as_dvec3() / f64::from(inverse);
        squares += DMat3::from_cols(row * row.x, row * row.y, row * row.z);
        sum += row;
    }
    // Rays differ by a few thousandths of a radian, so the determinant is tiny beside the cubed trace: far below f32
    // precision.
    let trace = squares.x_axis.x + squares.y_axis.y + squares.z_axis.z;
    (squares.determinant() > 1e-13 * trace.powi(3)).then(|| (squares.inverse() * sum).as_vec3())
}

/// Finds planes greedily, the one with the most inliers first. Each sample is an inlier of at most one plane.
fn planes(samples: &Image<Sample>) -> Vec<Vec3> {
    let least = (MIN_INLIER_SHARE * samples.pixels().len() as f32).ceil() as usize;
    let mut free: Vec<usize> = (0..samples.pixels().len()).collect();
    let mut planes = Vec::new();
    while planes.len() < MAX_PLANES && free.len() >= least {
        let index = planes.len() as u64;
        let inliers = |plane: Vec3| free.iter().filter(|&&i| samples.pixels()[i].is_inlier(plane)).count();
        let hypotheses: Vec<Vec3> =
            hypotheses(samples, &free, &mut lo_random::stream(0, "planes of predicted depth", index));
        let counted = hypotheses.into_par_iter().map(|plane| (inliers(plane), plane)).collect::<Vec<_>>();
        let Some((count, mut plane)) =
            counted.into_iter().reduce(|best, next| if next.0 > best.0 { next } else { best })
        else {
            break;
        };
        if count < least {
            break;
        }
        for _ in 0..REFINEMENTS {
            let inlier_samples = free.iter().map(|&i| samples.pixels()[i]).filter(|sample| sample.is_inlier(plane));
            plane = fit_plane(inlier_samples.map(|sample| (sample.ray, sample.inverse))).unwrap_or(plane);
        }
        free.retain(|&i| !samples.pixels()[i].is_inlier(plane));
        planes.push(plane);
    }
    planes
}

/// Draws planes through three samples, at most a quarter of the image apart.
fn hypotheses(samples: &Image<Sample>, free: &[usize], stream: &mut Stream) -> Vec<Vec3> {
    let (columns, rows) = (samples.width(), samples.height());
    let apart = columns.max(rows) / 4 + 1;
    let mut near =
        |at: usize, size: usize| (at + stream.random_range(0..=2 * apart)).saturating_sub(apart).min(size - 1);
    let mut planes = Vec::new();
    for draw in 0..HYPOTHESES {
        let first = free[draw * free.len() / HYPOTHESES];
        let at = (first % columns, first / columns);
        let three = [at, (near(at.0, columns), near(at.1, rows)), (near(at.0, columns), near(at.1, rows))];
        planes.extend(fit_plane(three.iter().map(|&at| (samples[at].ray, samples[at].inverse))));
    }
    planes
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    const WIDTH: usize = 160;
    const HEIGHT: usize = 120;

    fn camera() -> Camera {
        Camera::from_hfov_deg(70.0, WIDTH as u32, HEIGHT as u32).unwrap()
    }

    /// Returns the depth at a pixel of the nearest of the planes `normal · point = offset`.
    fn nearest(planes: &[(Vec3, f32)], x: usize, y: usize) -> f32 {
        let ray = camera().unproject(x as f64 + 0.5, y as f64 + 0.5, 1.0);
        let hit = |&(normal, offset): &(Vec3, f32)| Some(offset / normal.dot(ray)).filter(|&z| z > 0.0);
        planes.iter().filter_map(hit).fold(f32::INFINITY, f32::min)
    }

    /// A floor 1.4 m below a camera pitched down by 20°, and a wall.
    fn room(x: usize, y: usize) -> f32 {
        let (sin, cos) = 20f32.to_radians().sin_cos();
        nearest(&[(Vec3::new(0.0, cos, sin), -1.4), (Vec3::new(0.3, sin, -cos).normalize(), 3.6)], x, y)
    }

    fn wave(x: usize, y: usize) -> f32 {
        1.0 + 0.025 * (0.21 * x as f32).sin() * (0.17 * y as f32).cos()
    }

    #[test]
    fn waves_are_removed_from_floor_and_wall() {
        let wavy = DepthMap::from_fn(WIDTH, HEIGHT, |x, y| room(x, y) * wave(x, y));
        let flat = snap_to_planes(&wavy, &camera());
        let off = |depth_m: &DepthMap| {
            let pixels = (0..HEIGHT).flat_map(|y| (0..WIDTH).map(move |x| (x, y)));
            let mut off: Vec<f32> = pixels.map(|at| (depth_m[at] / room(at.0, at.1) - 1.0).abs()).collect();
            off.sort_by(f32::total_cmp);
            [0.5, 0.9].map(|share| off[(share * off.len() as f64) as usize])
        };
        let (before, after) = (off(&wavy), off(&flat));
        assert!(before[0] > 0.007 && after[0] < 0.002 && after[1] < 0.01, "{before:?} → {after:?}");
    }

    #[test]
    fn objects_in_front_of_planes_are_kept() {
        // A box of 0.4 m × 0.3 m in front of the wall, nearer than both planes by at least a tenth.
        let in_box = |x: usize, y: usize| (70..95).contains(&x) && (60..85).contains(&y);
        let scene =
            DepthMap::from_fn(WIDTH, HEIGHT, |x, y| if in_box(x, y) { 0.85 * room(80, 85) } else { room(x, y) });
        let flat = snap_to_planes(&scene, &camera());
        let off = |x: usize, y: usize| (flat[(x, y)] / scene[(x, y)] - 1.0).abs();
        for (x, y) in [(72, 62), (82, 70), (92, 78), (5, 115), (150, 115), (5, 5), (150, 5)] {
            assert!(off(x, y) < 0.005, "{x}, {y}: {} for {}", flat[(x, y)], scene[(x, y)]);
        }
    }

    #[test]
    fn results_do_not_depend_on_thread_count() {
        let wavy = DepthMap::from_fn(WIDTH, HEIGHT, |x, y| room(x, y) * wave(x, y));
        let found = [1, 3].map(|threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| snap_to_planes(&wavy, &camera()))
        });
        assert_eq!(found[0], found[1]);
    }

    /// No pixel moves farther than the tolerance, for any depth map.
    #[test]
    fn displacement_is_bounded() {
        let mut stream = lo_random::stream(1, "test", 0);
        for _ in 0..200 {
            let (width, height) = (stream.random_range(1..40), stream.random_range(1..40));
            let even: f32 = stream.random_range(0.0..1.0);
            let depth_m = DepthMap::from_fn(width, height, |_, _| stream.random_range(0.02f32..200.0).powf(1.0 - even));
            let flat = snap_to_planes(&depth_m, &Camera::from_hfov_deg(70.0, width as u32, height as u32).unwrap());
            for (before, after) in depth_m.pixels().iter().zip(flat.pixels()) {
                assert!(
                    after.is_finite() && (before / after - 1.0).abs() <= SNAP_TOLERANCE + 1e-4,
                    "{before} → {after}"
                );
            }
        }
    }
}
