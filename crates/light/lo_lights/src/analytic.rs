use std::f32::consts::{PI, TAU};

use lo_cone::{Cone, ConeSample, ConeTracer, Rendering};
use lo_geometry::{Mat3, Vec3, orthonormal_basis};
use lo_scene::{AnalyticLight, LightShape, LitScene};
use rayon::prelude::*;

use crate::emitters::tracer;
use crate::occlusion::unoccluded_share;
use crate::{LightPatch, PatchShape, Sunlit};

/// Opacity above which a sun is fully occluded.
const MAX_HIDDEN: f32 = 0.999;

/// Share of a cone's solid angle below which a rectangle is approximated by a disc of its solid angle.
const SMALL_SHARE: f32 = 0.25;

/// Rays per cone that sample a larger rectangle.
const RAYS: usize = 32;

/// Rays along a pixel's side that sample its coverage by a light; fewer for lights at least this many pixels wide.
const FINE_RAYS: usize = 16;
const COARSE_RAYS: usize = 4;
const COARSE_PIXELS: f32 = 24.0;

/// Lights of a scene that are not in the octree: added lights, and emitters that were moved.
///
/// They are visible in panoramas and mirrors where nothing of the room occludes them, and occlude nothing themselves,
/// as lamps in Cycles. Suns are occluded by observed surfaces except windows and lamps; inferred walls let them in.
pub struct AnalyticLights {
    lights: Vec<AnalyticLight>,
    sun_occluders: Option<ConeTracer>,
    /// Directions of the suns, and for suns of the photo where they shine.
    suns: Vec<(Vec3, Option<Sunlit>)>,
    leaf_edge_m: f32,
}

impl AnalyticLights {
    /// Collects the lights of a scene whose edits are applied; `None` if there are none.
    pub fn of(scene: &LitScene) -> Option<Self> {
        let edited = scene.edited.as_ref().filter(|edited| !edited.lights.is_empty())?;
        let sun = |light: &AnalyticLight| match light.shape {
            LightShape::Sun { direction, of_photo, .. } => Some((
                direction,
                if of_photo { Sunlit::new(scene.surface(), scene.surface_normals(), direction) } else { None },
            )),
            _ => None,
        };
        Some(Self {
            lights: edited.lights.clone(),
            suns: edited.lights.iter().filter_map(sun).collect(),
            sun_occluders: edited.sun_occluders.as_ref().map(tracer),
            leaf_edge_m: scene.light.cube.node_edge_m(scene.light.octree.depth()),
        })
    }

    /// Returns patches from which light samples are drawn.
    pub fn patches(&self) -> Vec<LightPatch> {
        self.lights.iter().flat_map(patches).collect()
    }

    /// Computes the unoccluded share of each of these rays to a sun. `points` are the lit points, from which ray
    /// origins may be offset.
    ///
    /// # Panics
    /// If there are not as many points as rays.
    pub fn unoccluded_to_suns(
        &self,
        rays: &[Cone],
        points: impl ExactSizeIterator<Item = Vec3>,
        shares: &mut Vec<f32>,
    ) {
        assert_eq!(rays.len(), points.len(), "one point for each ray");
        // The photo is finer than leaves, and includes the effect of unobserved occluders between there and the sun.
        let by_photo = |(ray, point): (&Cone, Vec3)| self.sunlit_of(ray.direction)?.share_at(point);
        let by_photo: Vec<Option<f32>> = rays.iter().zip(points).map(by_photo).collect();
        let others: Vec<Cone> =
            rays.iter().zip(&by_photo).filter(|(_, by_photo)| by_photo.is_none()).map(|(ray, _)| *ray).collect();
        let mut by_leaves = self.unoccluded_by_leaves(&others).into_iter();
        shares.clear();
        shares.extend(by_photo.into_iter().filter_map(|by_photo| by_photo.or_else(|| by_leaves.next())));
    }

    /// Returns the share of each of these rays that leaves do not occlude.
    fn unoccluded_by_leaves(&self, rays: &[Cone]) -> Vec<f32> {
        let Some(tracer) = &self.sun_occluders else { return vec![1.0; rays.len()] };
        let mut samples = vec![ConeSample::default(); rays.len()];
        tracer.trace_batch(rays, &mut samples);
        // Leaves transmit a ten-thousandth, which is bright for a sun.
        let free = |sample: &ConeSample| if sample.opacity > MAX_HIDDEN { 0.0 } else { 1.0 - sample.opacity };
        samples.iter().map(free).collect()
    }

    /// Returns the lit surfaces of the sun that a ray points to, if that sun is the photo's own.
    fn sunlit_of(&self, direction: Vec3) -> Option<&Sunlit> {
        let away = |sun: &(Vec3, Option<Sunlit>)| sun.0.dot(direction);
        self.suns.iter().max_by(|a, b| away(a).total_cmp(&away(b)))?.1.as_ref()
    }

    /// Adds the lights that cones see to their samples of the room.
    ///
    /// # Panics
    /// If there are not as many samples as cones.
    pub fn add(&self, cones: &[Cone], samples: &mut [ConeSample]) {
        assert_eq!(cones.len(), samples.len(), "one sample for each cone");
        let leaf_edge_m = self.leaf_edge_m;
        let (mut sunny, mut suns, mut shares) = (Vec::new(), Vec::new(), Vec::new());
        for (index, (cone, sample)) in cones.iter().zip(samples.iter_mut()).enumerate() {
            let (mut seen, mut sun) = (Vec3::ZERO, Vec3::ZERO);
            for light in &self.lights {
                let Some((share, distance_m)) = cone_coverage(&light.shape, cone) else { continue };
                let radiance = Vec3::from(light.radiance) * share;
                if distance_m.is_infinite() {
                    sun += radiance;
                } else {
                    seen += radiance * unoccluded_share(distance_m, sample, leaf_edge_m);
                }
            }
            sample.radiance = (Vec3::from(sample.radiance) + seen).to_array();
            if sun != Vec3::ZERO {
                sunny.push(*cone);
                suns.push((index, sun));
            }
        }
        self.unoccluded_to_suns(&sunny, sunny.iter().map(|cone| cone.origin), &mut shares);
        for ((index, sun), share) in suns.into_iter().zip(&shares) {
            samples[index].radiance = (Vec3::from(samples[index].radiance) + sun * *share).to_array();
        }
    }

    /// Adds the lights to an equirectangular panorama of the room, in this program's orientation. Each light has its
    /// exact solid angle, however small it is compared with a pixel.
    pub fn add_to_panorama(&self, eye_m: Vec3, panorama: &mut Rendering) {
        let (width, height) = (panorama.radiance.width(), panorama.radiance.height());
        let tan_half_angle = (PI / width as f32).tan();
        let leaf_edge_m = self.leaf_edge_m;
        for light in &self.lights {
            let covered = covered_pixels(&light.shape, eye_m, width, height);
            let cones: Vec<Cone> = covered
                .iter()
                .map(|pixel| Cone { origin: eye_m, direction: pixel.direction, tan_half_angle })
                .collect();
            let mut shares = Vec::new();
            if matches!(light.shape, LightShape::Sun { .. }) {
                self.unoccluded_to_suns(&cones, cones.iter().map(|cone| cone.origin), &mut shares);
            } else {
                shares.extend(covered.iter().map(|pixel| {
                    let (distance_m, opacity) = (panorama.distance_m[pixel.at], panorama.opacity[pixel.at]);
                    unoccluded_share(
                        pixel.distance_m,
                        &ConeSample { radiance: [0.0; 3], distance_m, opacity },
                        leaf_edge_m,
                    )
                }));
            }
            for (pixel, free) in covered.iter().zip(&shares) {
                let value = &mut panorama.radiance[pixel.at];
                *value = (Vec3::from(*value) + Vec3::from(light.radiance) * (pixel.share * free)).to_array();
            }
        }
    }
}

/// Returns the patches of a light's surface.
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

/// A light seen from a position, as a cone: unit direction of its centre, solid angle in steradians and distance.
struct ApparentLight {
    direction: Vec3,
    solid_angle_sr: f32,
    distance_m: f32,
}

impl ApparentLight {
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
                // It emits outwards, so it is dark from inside.
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

    /// Returns the angular radius of the disc of this solid angle.
    fn angular_radius(&self) -> f32 {
        2.0 * (self.solid_angle_sr / (2.0 * TAU)).sqrt().min(1.0).asin()
    }
}

/// Returns the solid angle of a cap whose angular radius has this sine: 2π (1 − cos), without cancellation for small
/// caps.
fn cap_solid_angle_sr(sin: f32) -> f32 {
    let sin = sin.min(1.0);
    TAU * sin * sin / (1.0 + (1.0 - sin * sin).sqrt())
}

/// Computes the exact solid angle of a rectangle as the sum of two triangles (Van Oosterom and Strackee 1983).
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

/// Returns the distance in metres at which a ray hits the emitting side of a light; infinite for suns.
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

/// Returns the share of a cone that a light covers, and its distance; `None` if it covers nothing.
fn cone_coverage(shape: &LightShape, cone: &Cone) -> Option<(f32, f32)> {
    let seen = ApparentLight::of(shape, cone.origin)?;
    let (half_angle, radius) = (cone.tan_half_angle.atan(), seen.angular_radius());
    let rectangle = matches!(shape, LightShape::Rectangle { .. });
    if rectangle && seen.solid_angle_sr > SMALL_SHARE * cap_solid_angle_sr(half_angle.sin()) {
        return sampled_coverage(shape, cone);
    }
    let apart = seen.direction.dot(cone.direction).clamp(-1.0, 1.0).acos();
    let share = overlap(apart, half_angle, radius);
    (share > 0.0).then_some((share, seen.distance_m))
}

/// Samples a light by rays distributed uniformly over a cone's disc (Vogel 1979).
fn sampled_coverage(shape: &LightShape, cone: &Cone) -> Option<(f32, f32)> {
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

/// Returns the share of a disc of radius `of` that a disc of radius `by` at distance `apart` covers. Angles are small
/// and treated as lengths.
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
struct CoveredPixel {
    at: (usize, usize),
    direction: Vec3,
    share: f32,
    distance_m: f32,
}

/// Returns the pixels that a light covers. Their shares are scaled so that together they have its solid angle.
fn covered_pixels(shape: &LightShape, eye_m: Vec3, width: usize, height: usize) -> Vec<CoveredPixel> {
    let Some(seen) = ApparentLight::of(shape, eye_m) else { return Vec::new() };
    // Around the centre, up to the farthest corner.
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
            (hits > 0).then_some(CoveredPixel { at: (x, y), direction, share, distance_m: nearest_m })
        };
        (0..width).filter_map(pixel).collect::<Vec<_>>()
    };
    let mut pixels: Vec<CoveredPixel> = (0..height).into_par_iter().flat_map_iter(of_row).collect();
    let solid_angle = |pixel: &CoveredPixel| pixel.share * lo_geometry::pixel_solid_angle_sr(pixel.at.1, width, height);
    let total: f32 = pixels.iter().map(solid_angle).sum();
    if total > 0.0 {
        let factor = seen.solid_angle_sr / total;
        pixels.iter_mut().for_each(|pixel| pixel.share *= factor);
    } else {
        let uv = lo_geometry::uv_from_direction(seen.direction);
        let place = |share: f32, size: usize| ((share * size as f32) as usize).min(size - 1);
        let at = (place(uv.x, width), place(uv.y, height));
        let share = seen.solid_angle_sr / lo_geometry::pixel_solid_angle_sr(at.1, width, height);
        pixels.push(CoveredPixel { at, direction: seen.direction, share, distance_m: seen.distance_m });
    }
    pixels
}

/// Creates a rectangle of this size and direction of emission, with its width as horizontal as possible.
pub fn rectangle(centre_m: Vec3, direction: Vec3, up: Vec3, size_m: [f32; 2], two_sided: bool) -> LightShape {
    let across = up.cross(direction).try_normalize().unwrap_or_else(|| {
        let Mat3 { x_axis, .. } = orthonormal_basis(direction);
        x_axis
    });
    LightShape::Rectangle { centre_m, direction, across, size_m, two_sided }
}
