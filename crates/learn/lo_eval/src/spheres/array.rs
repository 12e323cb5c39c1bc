//! Nine diffuse spheres on a plane, seen from above: the scene of the evaluation of Weber et al. (2022).
//!
//! Dimensions follow the `.blend` file of DiffusionLight-evaluation.

use std::f32::consts::{FRAC_1_PI, PI, TAU};

use lo_geometry::{Vec3, orthonormal_basis, pixel_direction, pixel_solid_angle_sr};
use lo_random::{RngExt, Stream};
use rayon::prelude::*;

use super::transport::{Row, Transport};

/// Radius of the spheres and distance between their centres, metres. They rest on the plane y = 0.
const RADIUS_M: f32 = 0.035;
const SPACING_M: f32 = 0.1;
/// Half the plane's edge, and rotation of the plane and the rows of spheres about the vertical.
const HALF_PLANE_M: f32 = 0.3;
const ROTATION_DEG: f32 = 46.3;
/// The camera looks straight down; the top of its image is towards the panorama's centre. 50 mm on a sensor of 36 mm.
const CAMERA_HEIGHT_M: f32 = 0.54;
const HALF_WIDTH_AT_1: f32 = 18.0 / 50.0;
/// Oren–Nayar's σ; the albedo is 1.
const SIGMA: f32 = 0.5;
/// Largest number of diffuse bounces: the default of Cycles.
const BOUNCES: usize = 4;

/// Side of the image, pixels: each covers 4 × 4 pixels of the published one.
const SIDE: usize = 64;
/// Panorama sizes for direct light, texels of 5.6°, and for indirect light, texels of 22.5°.
const DIRECT: [usize; 2] = [64, 32];
const INDIRECT: [usize; 2] = [16, 8];
/// Paths per pixel for indirect light.
const PATHS: usize = 256;

struct Hit {
    point: Vec3,
    normal: Vec3,
}

/// Computes the transport of the scene under distant light.
pub fn sphere_array() -> Transport {
    let spheres = SphereArray::new();
    let pixel = |index: usize| {
        let position = [index % SIDE, index / SIDE];
        let [x, y] = position.map(|p| (2.0 * (p as f32 + 0.5) / SIDE as f32 - 1.0) * HALF_WIDTH_AT_1);
        // Right is +X, up in the image is −Z.
        let direction = Vec3::new(x, -1.0, y).normalize();
        let hit = spheres.hit(Vec3::Y * CAMERA_HEIGHT_M, direction)?;
        let mut stream = lo_random::stream(0, "array of spheres", index as u64);
        let entries = spheres.entries(&hit, -direction, &mut stream);
        Some(Row { position: position.map(|p| p as u16), entries })
    };
    let rows: Vec<Row> = (0..SIDE * SIDE).into_par_iter().filter_map(pixel).collect();
    Transport::new(vec![DIRECT, INDIRECT], [SIDE; 2], rows)
}

/// Nine spheres on a square plane.
struct SphereArray {
    centres: [Vec3; 9],
    /// Directions of the plane's edges.
    edges: [Vec3; 2],
}

impl SphereArray {
    fn new() -> Self {
        let (sin, cos) = ROTATION_DEG.to_radians().sin_cos();
        // The rotated x and z axes of the file, in our frame.
        let edges = [Vec3::new(-sin, 0.0, -cos), Vec3::new(cos, 0.0, -sin)];
        let step = |i: usize| SPACING_M * (i as f32 - 1.0);
        let centres = std::array::from_fn(|i| edges[0] * step(i % 3) + edges[1] * step(i / 3) + Vec3::Y * RADIUS_M);
        Self { centres, edges }
    }

    /// Returns the nearest hit of a ray.
    fn hit(&self, origin: Vec3, direction: Vec3) -> Option<Hit> {
        let mut nearest = f32::INFINITY;
        let mut found = None;
        for &centre in &self.centres {
            if let Some(along) = sphere_distance(origin - centre, direction).filter(|along| *along < nearest) {
                nearest = along;
                let point = origin + direction * along;
                found = Some(Hit { point, normal: (point - centre).normalize() });
            }
        }
        let along = -origin.y / direction.y;
        if along > 0.0 && along < nearest {
            let point = origin + direction * along;
            if self.edges.iter().all(|edge| edge.dot(point).abs() < HALF_PLANE_M) {
                found = Some(Hit { point, normal: Vec3::Y * -direction.y.signum() });
            }
        }
        found
    }

    /// Returns the entries of the radiance that leaves a point towards `view`.
    fn entries(&self, hit: &Hit, view: Vec3, stream: &mut Stream) -> Vec<(u16, f32)> {
        let origin = hit.point + hit.normal * 1e-5;
        let mut entries = Vec::new();
        let [width, height] = DIRECT;
        for index in 0..width * height {
            let light = pixel_direction(index % width, index / width, width, height);
            let cosine = hit.normal.dot(light);
            if cosine > 0.0 && self.hit(origin, light).is_none() {
                let solid_angle = pixel_solid_angle_sr(index / width, width, height);
                entries.push((index as u16, oren_nayar(hit.normal, view, light) * cosine * solid_angle));
            }
        }
        let first = width * height;
        for (texel, weight) in self.indirect(hit, view, stream).into_iter().enumerate() {
            if weight > 0.0 {
                // A share of the paths is the weight of the texel's mean radiance.
                entries.push(((first + texel) as u16, weight));
            }
        }
        entries
    }

    /// Estimates indirect light by cosine-weighted paths over one to [`BOUNCES`] − 1 other surfaces.
    ///
    /// Each path adds to the texel in whose direction it leaves the scene.
    fn indirect(&self, hit: &Hit, view: Vec3, stream: &mut Stream) -> Vec<f32> {
        let [width, height] = INDIRECT;
        let mut weights = vec![0.0; width * height];
        for _ in 0..PATHS {
            let (mut point, mut normal, mut towards, mut carried) = (hit.point, hit.normal, view, 1.0 / PATHS as f32);
            for bounce in 0..BOUNCES {
                let direction = cosine_direction(normal, stream);
                carried *= oren_nayar(normal, towards, direction) * PI;
                match self.hit(point + normal * 1e-5, direction) {
                    Some(next) => (point, normal, towards) = (next.point, next.normal, -direction),
                    None => {
                        if bounce > 0 {
                            let uv = lo_geometry::uv_from_direction(direction);
                            let at = |t: f32, size: usize| ((t * size as f32) as usize).min(size - 1);
                            weights[at(uv.y, height) * width + at(uv.x, width)] += carried;
                        }
                        break;
                    }
                }
            }
        }
        weights
    }
}

/// Returns the distance along a ray, from outside, to a sphere around the origin.
fn sphere_distance(from: Vec3, direction: Vec3) -> Option<f32> {
    let along = -from.dot(direction);
    // From the point nearest to the centre, which avoids cancellation.
    let inside = RADIUS_M * RADIUS_M - (from + direction * along).length_squared();
    (inside > 0.0).then(|| along - inside.sqrt()).filter(|distance| *distance > 0.0)
}

/// Draws a cosine-weighted direction.
fn cosine_direction(normal: Vec3, stream: &mut Stream) -> Vec3 {
    let (radius_squared, turn): (f32, f32) = (stream.random(), stream.random());
    let (sin, cos) = (TAU * turn).sin_cos();
    let radius = radius_squared.sqrt();
    orthonormal_basis(normal) * Vec3::new(radius * cos, radius * sin, (1.0 - radius_squared).sqrt())
}

/// Returns the BRDF of albedo 1 by the qualitative model of Oren & Nayar (1994) in Fujii's form, as in Blender.
fn oren_nayar(normal: Vec3, view: Vec3, light: Vec3) -> f32 {
    let (n_l, n_v) = (normal.dot(light).max(0.0), normal.dot(view).max(0.0));
    let a = 1.0 / (PI + (3.0 * PI - 4.0) / 6.0 * SIGMA);
    let t = light.dot(view) - n_l * n_v;
    let t = if t > 0.0 { t / n_l.max(n_v).max(FRAC_1_PI * 1e-5) } else { t };
    (a * (1.0 + SIGMA * t)).max(0.0)
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use lo_imaging::RadianceImage;

    fn shown(light: impl Fn(Vec3) -> f32) -> lo_imaging::Image<[f32; 3]> {
        let transport = sphere_array();
        let map = RadianceImage::from_fn(128, 64, |x, y| [light(pixel_direction(x, y, 128, 64)); 3]);
        transport.picture(transport.render(&map).pixels(), [f32::NAN; 3])
    }

    #[test]
    fn the_scene_is_white_in_even_light_and_has_its_shadows_where_they_belong() {
        let white = shown(|_| 1.0);
        // The corner of the plane sees all of the sky and few white spheres. Its radiance is about its albedo, which
        // Fujii's form keeps near 1 for a view from above.
        let corner = white[(1, 1)][0];
        assert!((0.85..1.05).contains(&corner), "{corner}");
        // It is darker beside the central sphere. The image is 0.389 m wide at the plane, 6.1 mm per pixel.
        let beside = white[(SIDE / 2 + 7, SIDE / 2)][0];
        assert!(beside < 0.95 * corner, "{beside} {corner}");
        assert!(white.pixels().iter().flatten().all(|v| v.is_finite() && *v < 1.2));
        // Light from the right (+X) leaves the left of the central sphere dark.
        let right = shown(|d| if d.x > 0.8 { 10.0 } else { 0.0 });
        let (lit, dark) = (right[(SIDE / 2 + 3, SIDE / 2)][0], right[(SIDE / 2 - 3, SIDE / 2)][0]);
        assert!(lit > 3.0 * dark, "{lit} {dark}");
        // Light from the panorama's centre (−Z) comes from the top of the image.
        let front = shown(|d| if d.z < -0.8 { 10.0 } else { 0.0 });
        let (lit, dark) = (front[(SIDE / 2, SIDE / 2 - 3)][0], front[(SIDE / 2, SIDE / 2 + 3)][0]);
        assert!(lit > 3.0 * dark, "{lit} {dark}");
    }

    #[test]
    fn spheres_stand_in_three_turned_rows() {
        let spheres = SphereArray::new();
        // Rows of the file: 0.1 m apart, the central sphere at the origin.
        let nearest = |i: usize| {
            let others = spheres.centres.iter().enumerate().filter(|(j, _)| *j != i);
            others.map(|(_, c)| (*c - spheres.centres[i]).length()).fold(f32::INFINITY, f32::min)
        };
        assert!((0..9).all(|i| (nearest(i) - 0.1).abs() < 1e-6));
        assert!((spheres.centres[4] - Vec3::new(0.0, 0.035, 0.0)).length() < 1e-7);
        assert!((spheres.edges[0].cross(spheres.edges[1]).length() - 1.0).abs() < 1e-6);
    }
}
