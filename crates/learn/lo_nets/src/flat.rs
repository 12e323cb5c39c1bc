//! Predicted floors, tables and walls are wavy, real ones are flat.
//!
//! Planes are found in inverse depth, where a plane is linear: `1 / z = p · ray`. They are drawn at random, like RANSAC's (Fischler and Bolles 1981), the largest one
//! first; what lies near to one, and faces as it does, is laid onto it.

use lo_geometry::{Camera, DMat3, DVec3, Vec3};
use lo_imaging::{DepthMap, Image};
use lo_random::{RngExt, Stream};
use rayon::prelude::*;

/// Pixels from one sample to the next, of those that planes are drawn from.
const STRIDE: usize = 4;

/// Pixels on each side that the slope of depth is fitted to.
const REACH: usize = 6;

/// Planes at most, and the least share of the samples that one must carry.
const MAX_PLANES: usize = 6;
const MIN_SHARE: f32 = 0.05;

/// Drawn planes, of which the one that carries most is kept.
const DRAWS: usize = 600;

/// Share of the depth within which a sample carries a plane, and within which a pixel is laid onto it; between them by a part of the way.
const CARRIES: f32 = 0.03;
const LAID: f32 = 0.06;

/// Cosines between the normals of a pixel and a plane: from the second one on a sample carries it; from the first one on a pixel is laid onto it, by a part of the way.
const FACES: [f32; 2] = [0.7, 0.85];

/// Rounds of least squares over what carries a plane.
const ROUNDS: usize = 3;

/// What is nearly flat becomes flat. It hardly changes how far off depth is (`docs/design/046-flat-where-nearly-flat.md`), but where shadows fall, and what floors and mirrors show.
pub(crate) fn flattened(depth_m: &DepthMap, camera: &Camera) -> DepthMap {
    let (width, height) = (depth_m.width(), depth_m.height());
    let camera = camera.resized(width as u32, height as u32);
    let ray = |x: usize, y: usize| camera.unproject(x as f64 + 0.5, y as f64 + 0.5, 1.0);
    let (columns, rows) = (width.div_ceil(STRIDE), height.div_ceil(STRIDE));
    let samples: Vec<Sample> = (0..columns * rows)
        .into_par_iter()
        .map(|i| {
            let (x, y) = (i % columns * STRIDE, i / columns * STRIDE);
            Sample { ray: ray(x, y), inverse: 1.0 / depth_m[(x, y)], facing: facing(depth_m, x, y, ray) }
        })
        .collect();
    let samples = Image::new(columns, rows, samples);
    let planes = planes(&samples);
    let rows = (0..height).into_par_iter().flat_map_iter(|y| {
        let (planes, samples) = (&planes, &samples);
        (0..width).map(move |x| {
            let (ray, inverse) = (ray(x, y), 1.0 / depth_m[(x, y)]);
            let own = Sample { ray, inverse, ..samples[(x / STRIDE, y / STRIDE)] };
            let (mut sum, mut total) = (0.0, 0.0);
            for &plane in planes {
                let weight = own.laid(plane);
                sum += weight * plane.dot(ray);
                total += weight;
            }
            f32::max(total, 1.0) / (sum + f32::max(1.0 - total, 0.0) * inverse)
        })
    });
    DepthMap::new(width, height, rows.collect())
}

/// A pixel with its inverse depth and the plane through it, as depth around it says.
#[derive(Clone, Copy, Debug)]
struct Sample {
    ray: Vec3,
    inverse: f32,
    /// Unit vector; the normal away from the camera.
    facing: Vec3,
}

impl Sample {
    /// How far off a plane is, as a share of the depth.
    fn off(&self, plane: Vec3) -> f32 {
        (plane.dot(self.ray) / self.inverse - 1.0).abs()
    }

    fn carries(&self, plane: Vec3) -> bool {
        self.off(plane) < CARRIES && self.facing.dot(plane) > FACES[1] * plane.length()
    }

    /// By what part of the way it is laid onto a plane.
    fn laid(&self, plane: Vec3) -> f32 {
        let near = (LAID - self.off(plane)) / (LAID - CARRIES);
        let faces = (self.facing.dot(plane.normalize()) - FACES[0]) / (FACES[1] - FACES[0]);
        near.clamp(0.0, 1.0) * faces.clamp(0.0, 1.0)
    }
}

/// The unit vector of the plane that inverse depth around a pixel is nearest to, away from the camera.
fn facing(depth_m: &DepthMap, x: usize, y: usize, ray: impl Fn(usize, usize) -> Vec3) -> Vec3 {
    let near = |at: usize, size: usize| at.saturating_sub(REACH)..(at + REACH + 1).min(size);
    let pixels = near(y, depth_m.height()).flat_map(|y| near(x, depth_m.width()).map(move |x| (x, y)));
    let fitted = fitted(pixels.map(|(x, y)| (ray(x, y), 1.0 / depth_m[(x, y)])));
    fitted.and_then(Vec3::try_normalize).unwrap_or(-Vec3::Z)
}

/// The plane that is nearest to rays with inverse depths, weighted so that shares of depth count; `None` where they lie on a line.
fn fitted(points: impl Iterator<Item = (Vec3, f32)>) -> Option<Vec3> {
    let (mut squares, mut sum) = (DMat3::ZERO, DVec3::ZERO);
    for (ray, inverse) in points {
        let row = ray.as_dvec3() / f64::from(inverse);
        squares += DMat3::from_cols(row * row.x, row * row.y, row * row.z);
        sum += row;
    }
    // By a few thousandths of a radian they differ, so that the determinant's share of the cubed trace is far below a float's precision.
    let trace = squares.x_axis.x + squares.y_axis.y + squares.z_axis.z;
    (squares.determinant() > 1e-13 * trace.powi(3)).then(|| (squares.inverse() * sum).as_vec3())
}

/// The planes that carry most samples, each of which carries one at most.
fn planes(samples: &Image<Sample>) -> Vec<Vec3> {
    let least = (MIN_SHARE * samples.pixels().len() as f32).ceil() as usize;
    let mut free: Vec<usize> = (0..samples.pixels().len()).collect();
    let mut planes = Vec::new();
    while planes.len() < MAX_PLANES && free.len() >= least {
        let index = planes.len() as u64;
        let carried = |plane: Vec3| free.iter().filter(|&&i| samples.pixels()[i].carries(plane)).count();
        let drawn: Vec<Vec3> = drawn(samples, &free, &mut lo_random::stream(0, "planes of predicted depth", index));
        let counted = drawn.into_par_iter().map(|plane| (carried(plane), plane)).collect::<Vec<_>>();
        let Some((count, mut plane)) =
            counted.into_iter().reduce(|best, next| if next.0 > best.0 { next } else { best })
        else {
            break;
        };
        if count < least {
            break;
        }
        for _ in 0..ROUNDS {
            let on_it = free.iter().map(|&i| samples.pixels()[i]).filter(|sample| sample.carries(plane));
            plane = fitted(on_it.map(|sample| (sample.ray, sample.inverse))).unwrap_or(plane);
        }
        free.retain(|&i| !samples.pixels()[i].carries(plane));
        planes.push(plane);
    }
    planes
}

/// Planes through three samples, a quarter of the picture apart at most.
fn drawn(samples: &Image<Sample>, free: &[usize], stream: &mut Stream) -> Vec<Vec3> {
    let (columns, rows) = (samples.width(), samples.height());
    let apart = columns.max(rows) / 4 + 1;
    let mut near =
        |at: usize, size: usize| (at + stream.random_range(0..=2 * apart)).saturating_sub(apart).min(size - 1);
    let mut planes = Vec::new();
    for draw in 0..DRAWS {
        let first = free[draw * free.len() / DRAWS];
        let at = (first % columns, first / columns);
        let three = [at, (near(at.0, columns), near(at.1, rows)), (near(at.0, columns), near(at.1, rows))];
        planes.extend(fitted(three.iter().map(|&at| (samples[at].ray, samples[at].inverse))));
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

    /// Depth of the nearest of planes `normal · point = offset` at a pixel.
    fn nearest(planes: &[(Vec3, f32)], x: usize, y: usize) -> f32 {
        let ray = camera().unproject(x as f64 + 0.5, y as f64 + 0.5, 1.0);
        let hit = |&(normal, offset): &(Vec3, f32)| Some(offset / normal.dot(ray)).filter(|&z| z > 0.0);
        planes.iter().filter_map(hit).fold(f32::INFINITY, f32::min)
    }

    /// A floor 1.4 m below a camera that looks down by 20°, and a wall.
    fn room(x: usize, y: usize) -> f32 {
        let (sin, cos) = 20f32.to_radians().sin_cos();
        nearest(&[(Vec3::new(0.0, cos, sin), -1.4), (Vec3::new(0.3, sin, -cos).normalize(), 3.6)], x, y)
    }

    fn wave(x: usize, y: usize) -> f32 {
        1.0 + 0.025 * (0.21 * x as f32).sin() * (0.17 * y as f32).cos()
    }

    #[test]
    fn waves_go_from_floor_and_wall() {
        let wavy = DepthMap::from_fn(WIDTH, HEIGHT, |x, y| room(x, y) * wave(x, y));
        let flat = flattened(&wavy, &camera());
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
    fn what_stands_on_a_floor_stays() {
        // A box of 0.4 m × 0.3 m in front of the wall: nearer than either by a tenth and more.
        let in_box = |x: usize, y: usize| (70..95).contains(&x) && (60..85).contains(&y);
        let scene =
            DepthMap::from_fn(WIDTH, HEIGHT, |x, y| if in_box(x, y) { 0.85 * room(80, 85) } else { room(x, y) });
        let flat = flattened(&scene, &camera());
        let off = |x: usize, y: usize| (flat[(x, y)] / scene[(x, y)] - 1.0).abs();
        for (x, y) in [(72, 62), (82, 70), (92, 78), (5, 115), (150, 115), (5, 5), (150, 5)] {
            assert!(off(x, y) < 0.005, "{x}, {y}: {} for {}", flat[(x, y)], scene[(x, y)]);
        }
    }

    #[test]
    fn as_many_threads_as_there_are_say_the_same() {
        let wavy = DepthMap::from_fn(WIDTH, HEIGHT, |x, y| room(x, y) * wave(x, y));
        let found = [1, 3].map(|threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| flattened(&wavy, &camera()))
        });
        assert_eq!(found[0], found[1]);
    }

    /// Whatever depth is, nothing moves farther than it may.
    #[test]
    fn nothing_moves_far() {
        let mut stream = lo_random::stream(1, "test", 0);
        for _ in 0..200 {
            let (width, height) = (stream.random_range(1..40), stream.random_range(1..40));
            let even: f32 = stream.random_range(0.0..1.0);
            let depth_m = DepthMap::from_fn(width, height, |_, _| stream.random_range(0.02f32..200.0).powf(1.0 - even));
            let flat = flattened(&depth_m, &Camera::from_hfov_deg(70.0, width as u32, height as u32).unwrap());
            for (before, after) in depth_m.pixels().iter().zip(flat.pixels()) {
                assert!(after.is_finite() && (before / after - 1.0).abs() <= LAID + 1e-4, "{before} → {after}");
            }
        }
    }
}
