use std::f32::consts::{PI, TAU};

use lo_cone::{Cone, ConeSample, ConeTracer, Rendering};
use lo_geometry::{Mat3, Vec3, orthonormal_basis};
use lo_scene::{AnalyticLight, LightShape, LitScene};
use rayon::prelude::*;

use crate::emitters::tracer;
use crate::free::free_share;
use crate::{LightPatch, PatchShape, Sunlit};

/// Opacity from which on nothing of a sun comes through.
const MAX_HIDDEN: f32 = 0.999;

/// Share of a cone's solid angle below which a rectangle counts as a disc of its solid angle.
const SMALL_SHARE: f32 = 0.25;

/// Rays in a cone that ask where a larger rectangle is.
const RAYS: usize = 32;

/// Rays along a pixel's side that ask how much of the pixel a light covers: of lights that are this many pixels wide, fewer.
const FINE_RAYS: usize = 16;
const COARSE_RAYS: usize = 4;
const COARSE_PIXELS: f32 = 24.0;

/// A scene's lights that no octree holds: added ones, and emitters that were moved.
///
/// They are seen in panoramas and mirrors where nothing of the room lies before them, and hide nothing themselves, as lamps of Cycles do. Suns are hidden by
/// what the photo saw but windows and lamps; guessed walls let them in.
pub struct AnalyticLights {
    lights: Vec<AnalyticLight>,
    hides_suns: Option<ConeTracer>,
    /// Directions of the suns, and where those of the photo shine.
    suns: Vec<(Vec3, Option<Sunlit>)>,
    leaf_edge_m: f32,
}

impl AnalyticLights {
    /// Those of a scene whose edits were carried out; `None` where it has none.
    pub fn of(scene: &LitScene) -> Option<Self> {
        let edited = scene.edited.as_ref().filter(|edited| !edited.lights.is_empty())?;
        let sun = |light: &AnalyticLight| match light.shape {
            LightShape::Sun { direction, of_photo, .. } => {
                Some((direction, if of_photo { Sunlit::new(scene.surface(), direction) } else { None }))
            }
            _ => None,
        };
        Some(Self {
            lights: edited.lights.clone(),
            suns: edited.lights.iter().filter_map(sun).collect(),
            hides_suns: edited.hides_suns.as_ref().map(tracer),
            leaf_edge_m: scene.light.cube.node_edge_m(scene.light.octree.depth()),
        })
    }

    /// As patches to draw light samples from.
    pub fn patches(&self) -> Vec<LightPatch> {
        self.lights.iter().flat_map(patches).collect()
    }

    /// Share of each of these rays to a sun that is free. `places` are the points that are lit, which rays may begin beside.
    ///
    /// # Panics
    /// Where there are not as many places as rays.
    pub fn free_to_suns(&self, rays: &[Cone], places: impl ExactSizeIterator<Item = Vec3>, shares: &mut Vec<f32>) {
        assert_eq!(rays.len(), places.len(), "one place for each ray");
        // What the photo shows is finer than leaves, and knows what nobody saw between there and the sun.
        let told = |(ray, place): (&Cone, Vec3)| self.sunlit_by(ray.direction)?.share_at(place);
        let told: Vec<Option<f32>> = rays.iter().zip(places).map(told).collect();
        let others: Vec<Cone> =
            rays.iter().zip(&told).filter(|(_, told)| told.is_none()).map(|(ray, _)| *ray).collect();
        let mut by_leaves = self.free_by_leaves(&others).into_iter();
        shares.clear();
        shares.extend(told.into_iter().filter_map(|told| told.or_else(|| by_leaves.next())));
    }

    /// Share of each of these rays that leaves do not hide.
    fn free_by_leaves(&self, rays: &[Cone]) -> Vec<f32> {
        let Some(tracer) = &self.hides_suns else { return vec![1.0; rays.len()] };
        let mut samples = vec![ConeSample::default(); rays.len()];
        tracer.trace_batch(rays, &mut samples);
        // Leaves let a ten thousandth through, which of a sun is bright.
        let free = |sample: &ConeSample| if sample.opacity > MAX_HIDDEN { 0.0 } else { 1.0 - sample.opacity };
        samples.iter().map(free).collect()
    }

    /// Where the sun that a ray goes to shines, if it is the photo's own.
    fn sunlit_by(&self, direction: Vec3) -> Option<&Sunlit> {
        let away = |sun: &(Vec3, Option<Sunlit>)| sun.0.dot(direction);
        self.suns.iter().max_by(|a, b| away(a).total_cmp(&away(b)))?.1.as_ref()
    }

    /// Adds what cones see of the lights to their samples of the room.
    ///
    /// # Panics
    /// Where there are not as many samples as cones.
    pub fn add(&self, cones: &[Cone], samples: &mut [ConeSample]) {
        assert_eq!(cones.len(), samples.len(), "one sample for each cone");
        let leaf_edge_m = self.leaf_edge_m;
        let (mut sunny, mut suns, mut shares) = (Vec::new(), Vec::new(), Vec::new());
        for (index, (cone, sample)) in cones.iter().zip(samples.iter_mut()).enumerate() {
            let (mut seen, mut sun) = (Vec3::ZERO, Vec3::ZERO);
            for light in &self.lights {
                let Some((share, distance_m)) = covered(&light.shape, cone) else { continue };
                let radiance = Vec3::from(light.radiance) * share;
                if distance_m.is_infinite() {
                    sun += radiance;
                } else {
                    seen += radiance * free_share(distance_m, sample, leaf_edge_m);
                }
            }
            sample.radiance = (Vec3::from(sample.radiance) + seen).to_array();
            if sun != Vec3::ZERO {
                sunny.push(*cone);
                suns.push((index, sun));
            }
        }
        self.free_to_suns(&sunny, sunny.iter().map(|cone| cone.origin), &mut shares);
        for ((index, sun), share) in suns.into_iter().zip(&shares) {
            samples[index].radiance = (Vec3::from(samples[index].radiance) + sun * *share).to_array();
        }
    }

    /// Adds the lights to an equirectangular panorama of the room from a place, in our own orientation. Each has its exact solid angle, however small it is
    /// beside a pixel.
    pub fn add_to_panorama(&self, eye_m: Vec3, panorama: &mut Rendering) {
        let (width, height) = (panorama.radiance.width(), panorama.radiance.height());
        let tan_half_angle = (PI / width as f32).tan();
        let leaf_edge_m = self.leaf_edge_m;
        for light in &self.lights {
            let covered = coverage(&light.shape, eye_m, width, height);
            let cones: Vec<Cone> = covered
                .iter()
                .map(|pixel| Cone { origin: eye_m, direction: pixel.direction, tan_half_angle })
                .collect();
            let mut shares = Vec::new();
            if matches!(light.shape, LightShape::Sun { .. }) {
                self.free_to_suns(&cones, cones.iter().map(|cone| cone.origin), &mut shares);
            } else {
                shares.extend(covered.iter().map(|pixel| {
                    let (distance_m, opacity) = (panorama.distance_m[pixel.at], panorama.opacity[pixel.at]);
                    free_share(pixel.distance_m, &ConeSample { radiance: [0.0; 3], distance_m, opacity }, leaf_edge_m)
                }));
            }
            for (pixel, free) in covered.iter().zip(&shares) {
                let value = &mut panorama.radiance[pixel.at];
                *value = (Vec3::from(*value) + Vec3::from(light.radiance) * (pixel.share * free)).to_array();
            }
        }
    }
}

/// Patches of a light's surface.
fn patches(light: &AnalyticLight) -> Vec<LightPatch> {
    let radiance = Vec3::from(light.radiance);
    match light.shape {
        LightShape::Rectangle { centre_m: centre, direction, across, size_m: [width_m, height_m], two_sided } => {
            let edges_m = [across * width_m, direction.cross(across) * height_m];
            let side = |normal: Vec3| LightPatch {
                shape: PatchShape::Rectangle { centre, normal, edges_m },
                radiance,
                extent: width_m * height_m,
            };
            if two_sided { vec![side(direction), side(-direction)] } else { vec![side(direction)] }
        }
        LightShape::Sphere { centre_m: centre, radius_m } => {
            vec![LightPatch { shape: PatchShape::Sphere { centre, radius_m }, radiance, extent: light.extent() }]
        }
        LightShape::Sun { direction, angular_radius_deg, .. } => {
            let basis = orthonormal_basis(direction);
            let radii = [basis.x_axis, basis.y_axis].map(|axis| axis * angular_radius_deg.to_radians().tan());
            vec![LightPatch { shape: PatchShape::Disc { direction, radii }, radiance, extent: light.extent() }]
        }
    }
}

/// A light seen from a place as a cone: unit direction of its middle, its solid angle in steradians and its distance. `None` where it does not shine there.
struct Seen {
    direction: Vec3,
    solid_angle_sr: f32,
    distance_m: f32,
}

impl Seen {
    fn of(shape: &LightShape, eye_m: Vec3) -> Option<Self> {
        match *shape {
            LightShape::Rectangle { centre_m, direction, two_sided, .. } => {
                let offset = centre_m - eye_m;
                let facing = -offset.dot(direction);
                let distance_m = offset.length();
                (distance_m > 0.0 && (facing > 0.0 || (two_sided && facing < 0.0))).then(|| Self {
                    direction: offset / distance_m,
                    solid_angle_sr: rectangle_solid_angle_sr(shape, eye_m),
                    distance_m,
                })
            }
            LightShape::Sphere { centre_m, radius_m } => {
                let offset = centre_m - eye_m;
                let distance_m = offset.length();
                // From inside it is dark: it shines outwards.
                (distance_m > radius_m).then(|| Self {
                    direction: offset / distance_m,
                    solid_angle_sr: cap_solid_angle_sr(radius_m / distance_m),
                    distance_m: distance_m - radius_m,
                })
            }
            LightShape::Sun { direction, angular_radius_deg, .. } => Some(Self {
                direction,
                solid_angle_sr: cap_solid_angle_sr(angular_radius_deg.to_radians().sin()),
                distance_m: f32::INFINITY,
            }),
        }
    }

    /// Of the disc that covers this solid angle.
    fn angular_radius(&self) -> f32 {
        2.0 * (self.solid_angle_sr / (2.0 * TAU)).sqrt().min(1.0).asin()
    }
}

/// Of a cap whose angular radius has this sine: 2π (1 − cos), without losing small ones.
fn cap_solid_angle_sr(sin: f32) -> f32 {
    let sin = sin.min(1.0);
    TAU * sin * sin / (1.0 + (1.0 - sin * sin).sqrt())
}

/// Exact, by the sum of two triangles (Van Oosterom and Strackee 1983).
fn rectangle_solid_angle_sr(shape: &LightShape, eye_m: Vec3) -> f32 {
    let LightShape::Rectangle { centre_m, direction, across, size_m: [width_m, height_m], .. } = *shape else {
        return 0.0;
    };
    let (x, y) = (across * (0.5 * width_m), direction.cross(across) * (0.5 * height_m));
    let corner = |sx: f32, sy: f32| (centre_m + x * sx + y * sy - eye_m).normalize_or_zero();
    let corners = [corner(-1.0, -1.0), corner(1.0, -1.0), corner(1.0, 1.0), corner(-1.0, 1.0)];
    let triangle = |[a, b, c]: [Vec3; 3]| {
        let volume = a.dot(b.cross(c)).abs();
        2.0 * volume.atan2(1.0 + a.dot(b) + b.dot(c) + c.dot(a))
    };
    triangle([corners[0], corners[1], corners[2]]) + triangle([corners[0], corners[2], corners[3]])
}

/// Distance in metres at which a ray meets a light's side that shines there; infinite for suns.
fn hit(shape: &LightShape, origin: Vec3, direction: Vec3) -> Option<f32> {
    match *shape {
        LightShape::Rectangle { centre_m, direction: normal, across, size_m: [width_m, height_m], two_sided } => {
            let cosine = normal.dot(direction);
            if cosine == 0.0 || (cosine > 0.0 && !two_sided) {
                return None;
            }
            let distance_m = normal.dot(centre_m - origin) / cosine;
            let at = origin + direction * distance_m - centre_m;
            let within = at.dot(across).abs() <= 0.5 * width_m && at.dot(normal.cross(across)).abs() <= 0.5 * height_m;
            (distance_m > 0.0 && within).then_some(distance_m)
        }
        LightShape::Sphere { centre_m, radius_m } => {
            let offset = centre_m - origin;
            let along = offset.dot(direction);
            let squared = radius_m * radius_m - (offset - direction * along).length_squared();
            let distance_m = along - squared.max(0.0).sqrt();
            (squared >= 0.0 && distance_m > 0.0).then_some(distance_m)
        }
        LightShape::Sun { direction: towards, angular_radius_deg, .. } => {
            (towards.dot(direction) >= angular_radius_deg.to_radians().cos()).then_some(f32::INFINITY)
        }
    }
}

/// Share of a cone that a light covers, and how far away it is; `None` where it covers nothing.
fn covered(shape: &LightShape, cone: &Cone) -> Option<(f32, f32)> {
    let seen = Seen::of(shape, cone.origin)?;
    let (half_angle, radius) = (cone.tan_half_angle.atan(), seen.angular_radius());
    let rectangle = matches!(shape, LightShape::Rectangle { .. });
    if rectangle && seen.solid_angle_sr > SMALL_SHARE * cap_solid_angle_sr(half_angle.sin()) {
        return rays(shape, cone);
    }
    let apart = seen.direction.dot(cone.direction).clamp(-1.0, 1.0).acos();
    let share = overlap(apart, half_angle, radius);
    (share > 0.0).then_some((share, seen.distance_m))
}

/// By rays evenly over a cone's disc (Vogel 1979).
fn rays(shape: &LightShape, cone: &Cone) -> Option<(f32, f32)> {
    const GOLDEN_ANGLE_RAD: f32 = 2.399_963_2;
    let basis = orthonormal_basis(cone.direction);
    let (mut hits, mut nearest_m) = (0, f32::INFINITY);
    for i in 0..RAYS {
        let radius = ((i as f32 + 0.5) / RAYS as f32).sqrt() * cone.tan_half_angle;
        let (sin, cos) = (i as f32 * GOLDEN_ANGLE_RAD).sin_cos();
        let direction = (cone.direction + (basis.x_axis * cos + basis.y_axis * sin) * radius).normalize();
        if let Some(distance_m) = hit(shape, cone.origin, direction) {
            hits += 1;
            nearest_m = nearest_m.min(distance_m);
        }
    }
    (hits > 0).then_some((hits as f32 / RAYS as f32, nearest_m))
}

/// Share of a disc of radius `of` that another one, of radius `by` and at this distance, covers; small angles are taken as lengths.
fn overlap(apart: f32, of: f32, by: f32) -> f32 {
    if of <= 0.0 {
        return if apart <= by { 1.0 } else { 0.0 };
    }
    if apart >= of + by {
        return 0.0;
    }
    if apart <= (of - by).abs() {
        return if by >= of { 1.0 } else { (by / of).powi(2) };
    }
    let (a, r, s) = (f64::from(apart), f64::from(of), f64::from(by));
    let angle = |r: f64, s: f64| ((a * a + r * r - s * s) / (2.0 * a * r)).clamp(-1.0, 1.0).acos();
    let kite = ((-a + r + s) * (a + r - s) * (a - r + s) * (a + r + s)).max(0.0).sqrt();
    let area = r * r * angle(r, s) + s * s * angle(s, r) - 0.5 * kite;
    (area / (std::f64::consts::PI * r * r)).clamp(0.0, 1.0) as f32
}

/// A pixel of a panorama that a light covers in part.
struct Pixel {
    at: (usize, usize),
    direction: Vec3,
    share: f32,
    distance_m: f32,
}

/// The pixels that a light covers; the shares are such that together they have its solid angle.
fn coverage(shape: &LightShape, eye_m: Vec3, width: usize, height: usize) -> Vec<Pixel> {
    let Some(seen) = Seen::of(shape, eye_m) else { return Vec::new() };
    // Around the middle, as far as the farthest corner.
    let reach = match *shape {
        LightShape::Rectangle { centre_m, direction, across, size_m: [w, h], .. } => {
            let (x, y) = (across * (0.5 * w), direction.cross(across) * (0.5 * h));
            let corners =
                [x + y, x - y, -x + y, -x - y].map(|corner| (centre_m + corner - eye_m).normalize_or(seen.direction));
            corners.into_iter().map(|corner| corner.angle_between(seen.direction)).fold(0.0, f32::max)
        }
        _ => seen.angular_radius(),
    };
    let pitch = PI / height as f32;
    let rays = if 2.0 * reach > COARSE_PIXELS * pitch { COARSE_RAYS } else { FINE_RAYS };
    let least = (reach + 1.5 * pitch).min(PI).cos();
    let of_row = |y: usize| {
        let pixel = |x: usize| {
            let direction = lo_geometry::pixel_direction(x, y, width, height);
            if direction.dot(seen.direction) < least {
                return None;
            }
            let (mut hits, mut nearest_m) = (0, f32::INFINITY);
            for i in 0..rays * rays {
                let at = |i: usize, offset: usize, size: usize| {
                    (offset as f32 + (i as f32 + 0.5) / rays as f32) / size as f32
                };
                let uv = lo_geometry::Vec2::new(at(i % rays, x, width), at(i / rays, y, height));
                if let Some(distance_m) = hit(shape, eye_m, lo_geometry::direction_from_uv(uv)) {
                    hits += 1;
                    nearest_m = nearest_m.min(distance_m);
                }
            }
            let share = hits as f32 / (rays * rays) as f32;
            (hits > 0).then_some(Pixel { at: (x, y), direction, share, distance_m: nearest_m })
        };
        (0..width).filter_map(pixel).collect::<Vec<_>>()
    };
    let mut pixels: Vec<Pixel> = (0..height).into_par_iter().flat_map_iter(of_row).collect();
    let solid_angle = |pixel: &Pixel| pixel.share * lo_geometry::pixel_solid_angle_sr(pixel.at.1, width, height);
    let total: f32 = pixels.iter().map(solid_angle).sum();
    if total > 0.0 {
        let factor = seen.solid_angle_sr / total;
        pixels.iter_mut().for_each(|pixel| pixel.share *= factor);
    } else {
        let uv = lo_geometry::uv_from_direction(seen.direction);
        let place = |share: f32, size: usize| ((share * size as f32) as usize).min(size - 1);
        let at = (place(uv.x, width), place(uv.y, height));
        let share = seen.solid_angle_sr / lo_geometry::pixel_solid_angle_sr(at.1, width, height);
        pixels.push(Pixel { at, direction: seen.direction, share, distance_m: seen.distance_m });
    }
    pixels
}

/// The rectangle of this size in the direction that its light goes to, with its width as level as can be.
pub fn rectangle(centre_m: Vec3, direction: Vec3, up: Vec3, size_m: [f32; 2], two_sided: bool) -> LightShape {
    let across = up.cross(direction).try_normalize().unwrap_or_else(|| {
        let Mat3 { x_axis, .. } = orthonormal_basis(direction);
        x_axis
    });
    LightShape::Rectangle { centre_m, direction, across, size_m, two_sided }
}
