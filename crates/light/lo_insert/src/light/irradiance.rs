//! Irradiance of real surfaces without the objects. It does not depend on the objects and is cached.

use std::f32::consts::PI;
use std::ops::{Add, Mul};
use std::sync::OnceLock;

use lo_cone::Cone;
use lo_events::Cancelled;
use lo_geometry::Vec3;
use lo_imaging::Image;
use rayon::prelude::*;

use crate::batches::Batches;
use crate::light::aperture::cone_tangent;
use crate::light::environment::Environment;
use crate::light::room_light::{LightPart, LightRay};
use crate::light::samples::Incidence;
use crate::surface::observed_surfaces::Surface;
use crate::surface::receivers::{PATTERNS, Receivers, pattern_at};

/// Longer side of the grid on which irradiance is gathered; the octree resolves nothing finer than a few of its
/// pixels.
const SIDE: usize = 160;

/// Smallest share of a full neighbourhood for which the grid is used.
const MIN_SHARE: f32 = 0.2;

/// Solid angle of a cone as a share of its share of the sphere. Full cones would meet the surface that they start
/// from; the other patterns fill the gaps.
const APERTURE: f32 = 0.25;

const GOLDEN_ANGLE_RAD: f32 = 2.399_963_2;

/// Linear RGB irradiance of a real surface, in the photo's radiance units × sr.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct SurfaceIrradiance {
    /// Irradiance from the room without its lights.
    pub ambient: Vec3,
    /// Irradiance from the light samples.
    pub lights: Vec3,
    /// Lower bound, even if the octree lacks light: a surface emits no more than it receives, π L.
    pub least: Vec3,
}

impl Add for SurfaceIrradiance {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        let (ambient, lights, least) =
            (self.ambient + other.ambient, self.lights + other.lights, self.least + other.least);
        Self { ambient, lights, least }
    }
}

impl Mul<f32> for SurfaceIrradiance {
    type Output = Self;

    fn mul(self, factor: f32) -> Self {
        Self { ambient: self.ambient * factor, lights: self.lights * factor, least: self.least * factor }
    }
}

/// Irradiance of all [`Receivers`], computed on demand.
pub(crate) struct RoomIrradiance {
    /// Directions over the sphere, one set per pattern.
    directions: Vec<Vec<Vec3>>,
    cones: usize,
    lights: usize,
    /// Pixels from one grid point to the next.
    stride: usize,
    /// Irradiance by one pattern.
    single: Vec<OnceLock<Box<SurfaceIrradiance>>>,
    /// Mean over the neighbourhood, by all patterns.
    mean: Vec<OnceLock<Box<SurfaceIrradiance>>>,
}

impl RoomIrradiance {
    /// Creates an empty cache for `cones` over the sphere and `lights` light samples at each grid point.
    pub fn new(receivers: &Receivers, environment: &Environment, cones: usize, lights: usize) -> Self {
        let empty = || (0..receivers.width() * receivers.height()).map(|_| OnceLock::new()).collect();
        Self {
            directions: (0..PATTERNS)
                .map(|pattern| environment.fixed_in_room(sphere_pattern(cones, pattern)))
                .collect(),
            cones,
            lights,
            stride: receivers.width().max(receivers.height()).div_ceil(SIDE),
            single: empty(),
            mean: empty(),
        }
    }

    /// Computes missing values of the `wanted` pixels.
    ///
    /// # Errors
    /// [`Cancelled`]; values computed until then are kept.
    pub fn complete(
        &self,
        receivers: &Receivers,
        environment: &Environment,
        wanted: &Image<bool>,
        batches: &mut Batches<'_>,
    ) -> Result<(), Cancelled> {
        let width = receivers.width();
        let missing: Vec<(usize, usize)> = (0..wanted.pixels().len())
            .filter(|&i| wanted.pixels()[i] && self.mean[i].get().is_none())
            .map(|i| (i % width, i / width))
            .filter(|&pixel| receivers.surfaces[pixel].is_some())
            .collect();
        let mut needed = vec![false; wanted.pixels().len()];
        for &(x, y) in &missing {
            for (px, py, _) in receivers.neighbours(x, y, self.grid_for(receivers, x, y)) {
                needed[py * width + px] = true;
            }
        }
        let complete_row = |y: usize| {
            let pixels: Vec<(usize, Surface)> = (0..width)
                .filter(|&x| needed[y * width + x] && self.single[y * width + x].get().is_none())
                .filter_map(|x| Some((x, receivers.surfaces[(x, y)]?)))
                .collect();
            for ((x, _), value) in pixels.iter().zip(self.gather(environment, y, &pixels)) {
                // Another frame may have set it meanwhile, to the same value.
                let _ = self.single[y * width + x].set(Box::new(value));
            }
        };
        batches
            .each(receivers.height(), width * self.cones, 1, |rows| rows.into_par_iter().map(complete_row).collect())?;
        missing.par_iter().for_each(|&(x, y)| {
            let mut sum = (SurfaceIrradiance::default(), 0.0);
            for (px, py, weight) in receivers.neighbours(x, y, self.grid_for(receivers, x, y)) {
                if let Some(lit) = self.single[py * width + px].get() {
                    sum.0 = sum.0 + **lit * weight;
                    sum.1 += weight;
                }
            }
            let _ = self.mean[y * width + x].set(Box::new(sum.0 * (1.0 / f32::max(sum.1, 1e-9))));
        });
        Ok(())
    }

    /// Returns a computed value.
    pub fn at(&self, index: usize) -> Option<SurfaceIrradiance> {
        self.mean[index].get().map(|lit| **lit)
    }

    /// Returns the distance of grid points around a pixel; 1 on narrow surfaces.
    fn grid_for(&self, receivers: &Receivers, x: usize, y: usize) -> usize {
        let share: f32 = receivers.neighbours(x, y, self.stride).map(|(.., weight)| weight).sum();
        if share < MIN_SHARE { 1 } else { self.stride }
    }

    /// Gathers the irradiance of pixels of row `y`.
    fn gather(&self, environment: &Environment, y: usize, pixels: &[(usize, Surface)]) -> Vec<SurfaceIrradiance> {
        let mut lit = vec![SurfaceIrradiance::default(); pixels.len()];
        let tan_half_angle = cone_tangent(APERTURE * 4.0 * PI / self.cones as f32);
        let (mut cones, mut cone_owners, mut samples) = (Vec::new(), Vec::new(), Vec::new());
        let (mut rays, mut ray_owners, mut shares) = (Vec::new(), Vec::new(), Vec::new());
        for (i, (x, surface)) in pixels.iter().enumerate() {
            let on_grid = x % self.stride == 0 && y.is_multiple_of(self.stride);
            let stride = if on_grid { self.stride } else { 1 };
            let pattern = pattern_at(x / stride, y / stride);
            let origin = surface.position_m + surface.normal * environment.lift_m;
            let directions = &self.directions[pattern];
            let total: f32 = directions.iter().map(|d| surface.normal.dot(*d).max(0.0)).sum();
            for &direction in directions.iter().filter(|d| surface.normal.dot(**d) > 0.0) {
                cones.push(Cone { origin, direction, tan_half_angle });
                cone_owners.push((i, surface.normal.dot(direction) * PI / total));
            }
            let lights = environment.lights().subset(self.lights, pattern, PATTERNS);
            for incidence in lights.filter_map(|light| light.on(surface.position_m)) {
                let cosine = surface.normal.dot(incidence.direction);
                if cosine > 0.0 {
                    let Incidence { direction, distance_m, .. } = incidence;
                    rays.push(LightRay { place: surface.position_m, apex: origin, direction, distance_m });
                    ray_owners.push((i, incidence.irradiance * cosine));
                }
            }
        }
        environment.gather(LightPart::Rest, &cones, &mut samples);
        for ((i, weight), sample) in cone_owners.into_iter().zip(&samples) {
            lit[i].ambient += Vec3::from(sample.radiance) * weight;
        }
        environment.unoccluded_share(&rays, &mut shares);
        for ((i, light), share) in ray_owners.into_iter().zip(&shares) {
            lit[i].lights += light * *share;
        }
        let surfaces: Vec<Surface> = pixels.iter().map(|(_, surface)| *surface).collect();
        for (lit, radiance) in lit.iter_mut().zip(environment.exitant_radiance(&surfaces)) {
            lit.least = radiance * PI;
        }
        lit
    }
}

/// Returns pattern `pattern` of `count` directions over the sphere.
fn sphere_pattern(count: usize, pattern: usize) -> Vec<Vec3> {
    (0..count)
        .map(|i| {
            on_circle(1.0 - 2.0 * (i as f32 + (pattern as f32 + 0.5) / PATTERNS as f32) / count as f32, i, pattern)
        })
        .collect()
}

/// Returns the direction at height `z` whose longitude is that of point `i` of a pattern.
fn on_circle(z: f32, i: usize, pattern: usize) -> Vec3 {
    let turn = (pattern as u32).reverse_bits() as f32 / 4_294_967_296.0;
    let (sin, cos) = (i as f32 * GOLDEN_ANGLE_RAD + turn * std::f32::consts::TAU).sin_cos();
    let radius = (1.0 - z * z).max(0.0).sqrt();
    Vec3::new(radius * cos, radius * sin, z)
}
