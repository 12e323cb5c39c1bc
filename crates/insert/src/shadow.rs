//! Differential rendering (Debevec 1998): what the object takes from and gives to the light on real surfaces.
//!
//! For a real surface point with normal n, the photo's value is multiplied by
//! `(E − Δ) / E`, with the irradiance E of the room without the object and
//! `Δ = ∫ over the directions that meet the object of (what was seen there − what the object gives off) cos θ dω`, and the same
//! for the light samples that the object hides. E does not depend on the object and is kept once it is known.
//!
//! Patterns are interleaved (Keller and Heidrich 2001): sixteen pixels of a 4 × 4 block use sixteen disjoint patterns, and the filter
//! that follows takes each exactly once on a plane, which leaves no pattern and no noise.

use std::f32::consts::{PI, TAU};
use std::sync::OnceLock;

use cone::Cone;
use geometry::{Mat3, Ray, Vec3};
use imaging::Image;
use rayon::prelude::*;

use crate::brdf::cone_tangent;
use crate::environment::{Environment, Part, Scratch};
use crate::object::Object;
use crate::quality::Counts;
use crate::radiosity::Radiosity;
use crate::silhouette::Silhouettes;
use crate::surface::{Surface, SurfaceMap, bilinear};

/// Patterns of the interleaving.
pub(crate) const PATTERNS: usize = 16;

/// Order in which a 4 × 4 block uses the patterns: neighbours differ much (Bayer 1973).
const BAYER: [usize; PATTERNS] = [0, 8, 2, 10, 12, 4, 14, 6, 3, 11, 1, 9, 15, 7, 13, 5];

const GOLDEN_ANGLE_RAD: f32 = 2.399_963_2;

/// Points further from a pixel's tangent plane than this share of its depth belong to another surface.
const SAME_SURFACE: f32 = 0.02;

/// Holes up to twice this many pixels wide take the shadow of their surroundings.
const HOLE_FILL: usize = 6;

/// Real surfaces as receivers of shadow, with the light that they get without the object.
pub(crate) struct ShadowField {
    map: SurfaceMap,
    surfaces: Image<Option<Surface>>,
    /// Directions over the sphere, one set per pattern.
    directions: Vec<Vec<Vec3>>,
    irradiance: Vec<OnceLock<Vec3>>,
    cones: usize,
    lights: usize,
    /// Largest share of a receiver's hemisphere that is neglected.
    negligible: f32,
}

/// The factor on each pixel of a [`SurfaceMap`].
pub(crate) struct ShadowRatio<'a> {
    map: &'a SurfaceMap,
    surfaces: &'a Image<Option<Surface>>,
    ratio: Image<Vec3>,
}

impl ShadowField {
    pub fn new(map: SurfaceMap, counts: &Counts) -> Self {
        let directions = (0..PATTERNS).map(|pattern| sphere_pattern(counts.background_cones, pattern)).collect();
        let irradiance = (0..map.width() * map.height()).map(|_| OnceLock::new()).collect();
        let surfaces = Image::from_fn(map.width(), map.height(), |x, y| map.pixel(x, y));
        let (cones, lights) = (counts.background_cones, counts.background_lights);
        Self { map, surfaces, directions, irradiance, cones, lights, negligible: counts.negligible }
    }

    /// Computes the irradiance without the object of all pixels now, so that no frame has to.
    pub fn prepare(&self, environment: &Environment) {
        let all = vec![true; self.irradiance.len()];
        self.complete_irradiance(environment, &all);
    }

    /// The ratio with the object; without `radiosity` the object gives off nothing.
    pub fn ratio(
        &self,
        environment: &Environment,
        object: &Object,
        silhouettes: &Silhouettes,
        radiosity: Option<&Radiosity>,
    ) -> ShadowRatio<'_> {
        let (width, height) = (self.map.width(), self.map.height());
        let rows: Vec<Vec<Vec3>> = (0..height)
            .into_par_iter()
            .map(|y| self.loss_row(y, environment, object, silhouettes, radiosity))
            .collect();
        let loss = Image::new(width, height, rows.into_iter().flatten().collect());
        let needed = near_nonzero(&loss);
        self.complete_irradiance(environment, needed.pixels());
        let rows: Vec<Vec<Vec3>> = (0..height)
            .into_par_iter()
            .map(|y| (0..width).map(|x| if needed[(x, y)] { self.filtered(&loss, x, y) } else { Vec3::ONE }).collect())
            .collect();
        let mut ratio = Image::new(width, height, rows.into_iter().flatten().collect());
        self.fill_holes(&mut ratio);
        ShadowRatio { map: &self.map, surfaces: &self.surfaces, ratio }
    }

    /// Δ of a row of pixels.
    fn loss_row(
        &self,
        y: usize,
        environment: &Environment,
        object: &Object,
        silhouettes: &Silhouettes,
        radiosity: Option<&Radiosity>,
    ) -> Vec<Vec3> {
        let width = self.map.width();
        let mut loss = vec![Vec3::ZERO; width];
        let (mut blocked, mut samples) = (Vec::new(), Vec::new());
        let (mut rays, mut ray_owners, mut shares) = (Vec::new(), Vec::new(), Vec::new());
        for (x, loss) in loss.iter_mut().enumerate() {
            let Some(surface) = self.surfaces[(x, y)] else { continue };
            let Some(cap) = Cap::towards(object, &surface) else { continue };
            // Effects fade out where they are too small to be seen, and nothing is computed beyond.
            let share = cap.share(&surface);
            let strength = (share / self.negligible - 1.0).clamp(0.0, 1.0);
            if strength <= 0.0 {
                continue;
            }
            // The error of a few directions in a small cap is small. The last one counts in part, so that nothing jumps where
            // their number changes.
            let cones = self.cones as f32;
            let count = (cones * 2.0 * share).clamp(0.25 * cones, cones);
            let pattern = BAYER[(y % 4) * 4 + x % 4];
            let start = surface.position_m + surface.normal * (1e-3 * object.radius_m);
            let apex = surface.position_m + surface.normal * environment.lift_m;
            let solid_angle = cap.solid_angle_sr() / count;
            let tan_half_angle = quantised(cone_tangent(solid_angle));
            for (i, direction) in cap.directions(count.ceil() as usize, pattern, surface.normal).enumerate() {
                let cosine = surface.normal.dot(direction);
                if cosine <= 0.0 {
                    continue;
                }
                let ray = Ray { origin: start, direction };
                let Some(hit) = object.closest(&ray, f32::INFINITY) else { continue };
                let weight = strength * cosine * solid_angle * (count - i as f32).min(1.0);
                if let Some(radiosity) = radiosity {
                    *loss -= radiosity.radiance(object, &ray, &hit) * weight;
                }
                blocked.push((Cone { origin: apex, direction, tan_half_angle }, x, weight, i));
            }
            let (lights, scale) = environment.lights().subset(self.lights, pattern, PATTERNS);
            for (i, light) in lights.enumerate() {
                let Some(incidence) = light.on(surface.position_m) else { continue };
                let cosine = surface.normal.dot(incidence.direction);
                if cosine <= 0.0 {
                    continue;
                }
                let blocked = silhouettes.blocked(pattern, i, surface.position_m).unwrap_or_else(|| {
                    let ray = Ray { origin: start, direction: incidence.direction };
                    if object.blocks(&ray, incidence.distance_m) { 1.0 } else { 0.0 }
                });
                if blocked > 0.0 {
                    rays.push((apex, incidence.direction, incidence.distance_m));
                    ray_owners.push((x, incidence.irradiance * (scale * cosine * strength * blocked)));
                }
            }
        }
        // Cones of one aperture that go about the same way next to each other.
        blocked.sort_by(|(a, ax, _, ai), (b, bx, _, bi)| {
            a.tan_half_angle.total_cmp(&b.tan_half_angle).then((ai, ax % 4, ax).cmp(&(bi, bx % 4, bx)))
        });
        let cones: Vec<Cone> = blocked.iter().map(|&(cone, ..)| cone).collect();
        environment.gather(Part::DimmedInMotion, &cones, &mut samples);
        for ((_, x, weight, _), sample) in blocked.into_iter().zip(&samples) {
            loss[x] += Vec3::from(sample.radiance) * weight;
        }
        environment.free_share(&rays, &mut Scratch::default(), &mut shares);
        for ((x, irradiance), share) in ray_owners.into_iter().zip(&shares) {
            loss[x] += irradiance * *share;
        }
        loss
    }

    /// Fills in the irradiance without the object where it is wanted and not known yet.
    fn complete_irradiance(&self, environment: &Environment, wanted: &[bool]) {
        let width = self.map.width();
        (0..self.map.height()).into_par_iter().for_each(|y| {
            let missing = |x: &usize| wanted[y * width + x] && self.irradiance[y * width + x].get().is_none();
            let pixels: Vec<(usize, Surface)> =
                (0..width).filter(missing).filter_map(|x| Some((x, self.surfaces[(x, y)]?))).collect();
            for ((x, _), value) in pixels.iter().zip(self.irradiance_of(environment, y, &pixels)) {
                // A value that another frame has set meanwhile is the same.
                let _ = self.irradiance[y * width + x].set(value);
            }
        });
    }

    fn irradiance_of(&self, environment: &Environment, y: usize, pixels: &[(usize, Surface)]) -> Vec<Vec3> {
        let mut irradiance = vec![Vec3::ZERO; pixels.len()];
        let tan_half_angle = cone_tangent(4.0 * PI / self.cones as f32);
        let (mut cones, mut cone_owners, mut samples) = (Vec::new(), Vec::new(), Vec::new());
        let (mut rays, mut ray_owners, mut shares) = (Vec::new(), Vec::new(), Vec::new());
        for (i, (x, surface)) in pixels.iter().enumerate() {
            let pattern = BAYER[(y % 4) * 4 + x % 4];
            let origin = surface.position_m + surface.normal * environment.lift_m;
            let directions = &self.directions[pattern];
            let total: f32 = directions.iter().map(|d| surface.normal.dot(*d).max(0.0)).sum();
            for &direction in directions.iter().filter(|d| surface.normal.dot(**d) > 0.0) {
                cones.push(Cone { origin, direction, tan_half_angle });
                cone_owners.push((i, surface.normal.dot(direction) * PI / total));
            }
            let (lights, scale) = environment.lights().subset(self.lights, pattern, PATTERNS);
            for incidence in lights.filter_map(|light| light.on(surface.position_m)) {
                let cosine = surface.normal.dot(incidence.direction);
                if cosine > 0.0 {
                    rays.push((origin, incidence.direction, incidence.distance_m));
                    ray_owners.push((i, incidence.irradiance * (scale * cosine)));
                }
            }
        }
        environment.gather(Part::Dimmed, &cones, &mut samples);
        for ((i, weight), sample) in cone_owners.into_iter().zip(&samples) {
            irradiance[i] += Vec3::from(sample.radiance) * weight;
        }
        environment.free_share(&rays, &mut Scratch::default(), &mut shares);
        for ((i, light), share) in ray_owners.into_iter().zip(&shares) {
            irradiance[i] += light * *share;
        }
        irradiance
    }

    /// `1 − ΣΔ / ΣE` over 5 × 5 pixels whose outer ones count half: each of the sixteen patterns weighs the same.
    fn filtered(&self, loss: &Image<Vec3>, x: usize, y: usize) -> Vec3 {
        let Some(centre) = self.surfaces[(x, y)] else { return Vec3::ONE };
        let tolerance_m = SAME_SURFACE * self.map.depth_m[(x, y)];
        let (mut lost, mut lit) = (Vec3::ZERO, Vec3::ZERO);
        for dy in -2i32..=2 {
            for dx in -2i32..=2 {
                let (Some(px), Some(py)) = (x.checked_add_signed(dx as isize), y.checked_add_signed(dy as isize))
                else {
                    continue;
                };
                if px >= self.map.width() || py >= self.map.height() {
                    continue;
                }
                let Some(other) = self.surfaces[(px, py)] else { continue };
                let Some(&irradiance) = self.irradiance[py * self.map.width() + px].get() else { continue };
                let off_plane_m = centre.normal.dot(other.position_m - centre.position_m).abs();
                if off_plane_m > tolerance_m || centre.normal.dot(other.normal) < 0.8 {
                    continue;
                }
                let weight = if dx.abs() == 2 { 0.5 } else { 1.0 } * if dy.abs() == 2 { 0.5 } else { 1.0 };
                lost += loss[(px, py)] * weight;
                lit += irradiance * weight;
            }
        }
        if lost == Vec3::ZERO {
            return Vec3::ONE;
        }
        let ratio = |lost: f32, lit: f32| if lit > 1e-9 { (1.0 - lost / lit).clamp(0.0, 16.0) } else { 1.0 };
        Vec3::new(ratio(lost.x, lit.x), ratio(lost.y, lit.y), ratio(lost.z, lit.z))
    }

    /// Carries the shadow on over small holes of the depth map, ring by ring from their edges.
    fn fill_holes(&self, ratio: &mut Image<Vec3>) {
        let (width, height) = (ratio.width(), ratio.height());
        let mut known = Image::from_fn(width, height, |x, y| self.surfaces[(x, y)].is_some());
        let mut open: Vec<(usize, usize)> =
            (0..width * height).map(|i| (i % width, i / width)).filter(|&pixel| !known[pixel]).collect();
        for _ in 0..HOLE_FILL {
            let mut filled = Vec::new();
            open.retain(|&(x, y)| {
                let mut sum = (Vec3::ZERO, 0.0);
                for py in y.saturating_sub(1)..(y + 2).min(height) {
                    for px in (x.saturating_sub(1)..(x + 2).min(width)).filter(|&px| known[(px, py)]) {
                        sum.0 += ratio[(px, py)];
                        sum.1 += 1.0;
                    }
                }
                if sum.1 > 0.0 {
                    filled.push(((x, y), sum.0 / sum.1));
                }
                sum.1 == 0.0
            });
            for (pixel, value) in filled {
                ratio[pixel] = value;
                known[pixel] = true;
            }
        }
    }
}

impl ShadowRatio<'_> {
    /// Pixels `(left, top, right, bottom)`, the last two exclusive, of a photo of the given size outside of which the factor is 1.
    pub fn reach(&self, width: usize, height: usize) -> (usize, usize, usize, usize) {
        let (columns, rows) = (self.ratio.width(), self.ratio.height());
        let (mut left, mut top, mut right, mut bottom) = (columns, rows, 0, 0);
        for y in 0..rows {
            let row = &self.ratio.pixels()[y * columns..(y + 1) * columns];
            let changed = |ratio: &Vec3| *ratio != Vec3::ONE;
            if let (Some(first), Some(last)) = (row.iter().position(changed), row.iter().rposition(changed)) {
                (left, right) = (left.min(first), right.max(last + 1));
                (top, bottom) = (top.min(y), y + 1);
            }
        }
        // A pixel looks at the four around it: up to one beyond on each side.
        let low = |at: usize, from: usize, to: usize| at.saturating_sub(1) * to / from;
        let high = |at: usize, from: usize, to: usize| ((at + 1) * to).div_ceil(from).min(to);
        (low(left, columns, width), low(top, rows, height), high(right, columns, width), high(bottom, rows, height))
    }

    /// The factor on the real surface at a world point; 1 where the photo does not see it.
    pub fn at(&self, point: Vec3) -> Vec3 {
        let Some((x, y)) = self.map.pixel_of(point) else { return Vec3::ONE };
        let z = self.map.depth_m[(x, y)];
        let tolerance_m = 0.05 * z;
        let Some(surface) = self.surfaces[(x, y)] else { return Vec3::ONE };
        if surface.normal.dot(point - surface.position_m).abs() > tolerance_m { Vec3::ONE } else { self.ratio[(x, y)] }
    }

    /// The factor for a photo pixel at relative position `(u, v)` with the real surface `seen` there.
    pub fn for_photo(&self, u: f32, v: f32, seen: impl FnOnce() -> Option<Vec3>) -> Vec3 {
        let (width, height) = (self.ratio.width(), self.ratio.height());
        let taps = bilinear(u * width as f32 - 0.5, v * height as f32 - 0.5, width, height);
        if taps.iter().all(|&(x, y, _)| self.ratio[(x, y)] == Vec3::ONE) {
            return Vec3::ONE;
        }
        let point = seen();
        let mut sum = (Vec3::ZERO, 0.0);
        for (x, y, weight) in taps {
            let closeness = match (point, self.surfaces[(x, y)]) {
                (Some(point), Some(surface)) => {
                    let off_plane =
                        surface.normal.dot(point - surface.position_m) / (SAME_SURFACE * self.map.depth_m[(x, y)]);
                    (1.0 + off_plane * off_plane).powi(-4)
                }
                _ => 1.0,
            };
            // A little weight for every tap keeps the sum away from zero.
            let weight = (weight + 1e-4) * closeness;
            sum.0 += self.ratio[(x, y)] * weight;
            sum.1 += weight;
        }
        sum.0 / sum.1
    }
}

/// The cap of directions from a surface point that holds the whole object.
struct Cap {
    axis: Vec3,
    cos_half_angle: f32,
}

impl Cap {
    /// `None` where all of it lies below the surface.
    fn towards(object: &Object, surface: &Surface) -> Option<Self> {
        let offset = object.centre_m - surface.position_m;
        let (distance_m, radius_m) = (offset.length(), object.radius_m);
        let axis = offset / distance_m.max(1e-9);
        // Beyond a right angle from inside of the bounding sphere, up to the whole sphere at its centre.
        let cos_half_angle = if distance_m > radius_m {
            (1.0 - (radius_m / distance_m).powi(2)).sqrt()
        } else {
            -(1.0 - (distance_m / radius_m).powi(2)).max(0.0).sqrt()
        };
        let sin_half_angle = (1.0 - cos_half_angle * cos_half_angle).max(0.0).sqrt();
        let below = cos_half_angle > 0.0 && surface.normal.dot(axis) < -sin_half_angle;
        (!below && axis.is_finite()).then_some(Self { axis, cos_half_angle })
    }

    fn solid_angle_sr(&self) -> f32 {
        TAU * (1.0 - self.cos_half_angle)
    }

    /// Upper bound of the share of the irradiance that comes from the cap.
    fn share(&self, surface: &Surface) -> f32 {
        let sin = (1.0 - self.cos_half_angle * self.cos_half_angle).max(0.0).sqrt();
        self.solid_angle_sr() / PI * (surface.normal.dot(self.axis) + sin).clamp(0.0, 1.0)
    }

    /// The first `count` directions of a pattern. They are spread evenly for every `count`, alone and together with those of the
    /// other patterns (R₂ sequence, Roberts 2018).
    fn directions(&self, count: usize, pattern: usize, normal: Vec3) -> impl Iterator<Item = Vec3> {
        // Turned along with the surface, not with the world's axes: no direction jumps while the object moves.
        let side = self.axis.cross(normal);
        let side = if side.length_squared() > 1e-6 { side.normalize() } else { self.axis.any_orthonormal_vector() };
        let basis = Mat3::from_cols(side, self.axis.cross(side), self.axis);
        let height = 1.0 - self.cos_half_angle;
        (0..count).map(move |i| {
            let k = (i * PATTERNS + pattern) as f32 + 0.5;
            let z = 1.0 - height * (k * 0.754_877_7).fract();
            let (sin, cos) = ((k * 0.569_840_3).fract() * TAU).sin_cos();
            let radius = (1.0 - z * z).max(0.0).sqrt();
            basis * Vec3::new(radius * cos, radius * sin, z)
        })
    }
}

/// Pattern `pattern` of `count` directions over the sphere.
fn sphere_pattern(count: usize, pattern: usize) -> Vec<Vec3> {
    (0..count)
        .map(|i| {
            on_circle(1.0 - 2.0 * (i as f32 + (pattern as f32 + 0.5) / PATTERNS as f32) / count as f32, i, pattern)
        })
        .collect()
}

/// The direction at height `z` whose longitude is that of point `i` of a pattern.
fn on_circle(z: f32, i: usize, pattern: usize) -> Vec3 {
    let turn = (pattern as u32).reverse_bits() as f32 / 4_294_967_296.0;
    let (sin, cos) = (i as f32 * GOLDEN_ANGLE_RAD + turn * TAU).sin_cos();
    let radius = (1.0 - z * z).max(0.0).sqrt();
    Vec3::new(radius * cos, radius * sin, z)
}

/// Rounded to quarter octaves: cones of one tangent share their steps.
pub(crate) fn quantised(tangent: f32) -> f32 {
    ((4.0 * tangent.max(1e-4).log2()).round() / 4.0).exp2()
}

/// Where a 5 × 5 window holds anything but zero.
fn near_nonzero(loss: &Image<Vec3>) -> Image<bool> {
    let (width, height) = (loss.width(), loss.height());
    let along_x = Image::from_fn(width, height, |x, y| {
        (x.saturating_sub(2)..(x + 3).min(width)).any(|px| loss[(px, y)] != Vec3::ZERO)
    });
    Image::from_fn(width, height, |x, y| (y.saturating_sub(2)..(y + 3).min(height)).any(|py| along_x[(x, py)]))
}
