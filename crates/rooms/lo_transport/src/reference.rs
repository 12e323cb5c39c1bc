//! Reference path tracer without cache, filter or approximation. Slow; serves as ground truth.
//!
//! It shares materials and ray casting with [`crate::BakedWorld`], but neither light sampling nor transport. Both omit
//! caustics of the sun: its light reflected onto matte surfaces by mirrors.

use std::f32::consts::{PI, TAU};

use lo_geometry::{Ray, Vec2, Vec3, orthonormal_basis};
use lo_imaging::{Image, RadianceImage};
use lo_random::{RngExt, Stream};
use rayon::prelude::*;

use crate::pattern::{self, shifted};
use crate::traced_world::{SurfaceInteraction, TracedWorld};
use crate::{TransportError, View, World};

/// Path length from which Russian roulette applies.
const MIN_ROULETTE_BOUNCES: u32 = 5;

/// Maximum path length.
const MAX_BOUNCES: u32 = 256;

/// Unbiased path tracer with next-event estimation and multiple importance sampling (Veach 1997).
pub struct PathTracer {
    world: TracedWorld,
    lamps: Vec<Lamp>,
    /// Cumulative lamp weights.
    lamp_sums: Vec<f32>,
    portal_area_m2: f32,
    seed: u64,
}

/// Emissive triangle.
struct Lamp {
    triangle: u32,
    corners: [Vec3; 3],
    area_m2: f32,
    weight: f32,
}

/// Last vertex at which the path scattered.
#[derive(Clone, Copy)]
struct PathVertex {
    position: Vec3,
    /// Density per steradian with which the ray was sampled. `None` for mirrors and the eye.
    pdf_per_sr: Option<f32>,
}

impl PathTracer {
    /// Prepares a world for path tracing. `seed` selects the random streams.
    ///
    /// # Errors
    /// See [`TransportError`].
    pub fn new(world: World, seed: u64) -> Result<Self, TransportError> {
        let world = TracedWorld::new(world)?;
        let model = world.prepared.model();
        let mut lamps = Vec::new();
        for (triangle, corners) in model.triangles.iter().enumerate() {
            let material = &model.materials[model.triangle_materials[triangle] as usize];
            let corners = corners.map(|v| model.positions[v as usize]);
            let area_m2 = 0.5 * (corners[1] - corners[0]).cross(corners[2] - corners[0]).length();
            let weight = area_m2 * material.emissive.iter().sum::<f32>();
            if weight > 0.0 && !material.unlit {
                lamps.push(Lamp { triangle: triangle as u32, corners, area_m2, weight });
            }
        }
        let running = |sum: &mut f32, lamp: &Lamp| {
            *sum += lamp.weight;
            Some(*sum)
        };
        let lamp_sums = lamps.iter().scan(0.0, running).collect();
        let portal_area_m2 = world.sky.portals.iter().map(|o| area(o.portal.edges)).sum();
        Ok(Self { world, lamps, lamp_sums, portal_area_m2, seed })
    }

    /// Renders a view. Each pixel is the mean radiance of `samples` paths through random points of it.
    pub fn render(&self, view: &View, samples: u32) -> RadianceImage {
        let (width, height) = view.size();
        let pixel = |i: usize| {
            let mut stream = lo_random::stream(self.seed, "reference view", i as u64);
            let shift = [stream.random(), stream.random()];
            let mut sum = Vec3::ZERO;
            for sample in 0..samples {
                let Vec2 { x, y } = pattern::r2(sample);
                let (u, v) = ((i % width) as f32 + shifted(x, shift[0]), (i / width) as f32 + shifted(y, shift[1]));
                sum += self.radiance(view.ray(u, v), &mut stream);
            }
            (sum / samples as f32).to_array()
        };
        Image::new(width, height, (0..width * height).into_par_iter().map(pixel).collect())
    }

    /// Returns the irradiance at a point for a surface with the given unit normal, as the mean of `samples` paths.
    /// `index` selects the random stream.
    pub fn irradiance(&self, point: Vec3, normal: Vec3, samples: u32, index: u64) -> [f32; 3] {
        let mut stream = lo_random::stream(self.seed, "reference irradiance", index);
        let basis = orthonormal_basis(normal);
        let mut sum = Vec3::ZERO;
        for _ in 0..samples {
            let surface = matte(point, normal);
            sum += self.next_event(&surface, &mut stream) * PI;
            let direction = basis * cosine_direction(&mut stream);
            let vertex = PathVertex { position: point, pdf_per_sr: Some(normal.dot(direction).max(0.0) / PI) };
            sum += self.path(surface.ray(direction), vertex, 1, &mut stream) * PI;
        }
        (sum / samples as f32).to_array()
    }

    /// Returns the irradiance as [`irradiance`](Self::irradiance) does, from the single path of random stream `index`.
    /// In two worlds the paths are identical until they meet a difference.
    pub fn irradiance_by_path(&self, point: Vec3, normal: Vec3, index: u64) -> [f32; 3] {
        self.irradiance(point, normal, 1, index)
    }

    /// Returns the radiance that arrives at the origin of a ray, from the single path of random stream `index`.
    pub fn radiance_by_path(&self, ray: Ray, index: u64) -> [f32; 3] {
        self.radiance(ray, &mut lo_random::stream(self.seed, "reference ray", index)).to_array()
    }

    /// Returns the radiance along a ray, from one path.
    fn radiance(&self, ray: Ray, stream: &mut Stream) -> Vec3 {
        self.path(ray, PathVertex { position: ray.origin, pdf_per_sr: None }, 0, stream)
    }

    fn path(&self, mut ray: Ray, mut last: PathVertex, bounces: u32, stream: &mut Stream) -> Vec3 {
        let (mut light, mut throughput) = (Vec3::ZERO, Vec3::ONE);
        // The sun's disc counts for the eye and mirrors, unless a matte surface is in between.
        let mut matte_before = bounces > 0;
        for bounce in bounces..MAX_BOUNCES {
            let Some(hit) = self.world.hit(&ray) else {
                return light + throughput * self.sky(&ray, last, matte_before);
            };
            let surface = self.world.interaction(&hit, &ray, 0.0);
            if surface.emission != Vec3::ZERO {
                let weight = last.pdf_per_sr.map_or(1.0, |density| {
                    let to = surface.position - last.position;
                    let cosine = surface.geometric_normal.dot(ray.direction).abs();
                    balance(density, self.lamp_density(hit.triangle) * to.length_squared() / cosine.max(1e-6))
                });
                light += throughput * surface.emission * weight;
            }
            light += throughput * self.next_event(&surface, stream);
            let Some((next, weight, density)) = scatter(&surface, stream) else { break };
            throughput *= weight;
            match density {
                Continuation::Straight => {}
                Continuation::Mirror => last = PathVertex { position: surface.position, pdf_per_sr: None },
                Continuation::Scattered(density) => {
                    last = PathVertex { position: surface.position, pdf_per_sr: Some(density) };
                    matte_before = true;
                }
            }
            ray = next;
            if bounce >= MIN_ROULETTE_BOUNCES {
                let survival = throughput.max_element().min(0.95);
                if stream.random::<f32>() >= survival {
                    break;
                }
                throughput /= survival;
            }
        }
        light
    }

    fn sky(&self, ray: &Ray, last: PathVertex, matte_before: bool) -> Vec3 {
        let sky = &self.world.sky;
        if !sky.is_open(&Ray { origin: last.position, direction: ray.direction }, self.world.far_m) {
            return Vec3::ZERO;
        }
        let open = sky.radiance(ray.direction);
        let weight = last.pdf_per_sr.map_or(1.0, |density| {
            let portals = sky.portals.iter().map(|opening| {
                let portal = &opening.portal;
                let cosine = -ray.direction.dot(opening.normal);
                let distance = (last.position - portal.corner).dot(opening.normal) / cosine.max(1e-6);
                let from = Ray { origin: last.position, direction: ray.direction };
                let crosses = cosine > 0.0 && crosses(opening.portal.edges, from.at(distance) - portal.corner);
                if crosses { distance * distance / (cosine * self.portal_area_m2) } else { 0.0 }
            });
            balance(density, portals.sum())
        });
        let sun = if matte_before { Vec3::ZERO } else { sky.radiance_with_sun(ray.direction) - open };
        open * weight + sun
    }

    /// Returns the light of one sample each of lamps, portals and sun, scattered towards the viewer.
    fn next_event(&self, surface: &SurfaceInteraction, stream: &mut Stream) -> Vec3 {
        if surface.diffuse == Vec3::ZERO && surface.through == Vec3::ZERO && !surface.is_glossy() {
            return Vec3::ZERO;
        }
        let shadowed = |direction: Vec3, distance_m: f32| self.world.transmittance(&surface.ray(direction), distance_m);
        let random: [f32; 7] = std::array::from_fn(|_| stream.random());
        let mut light = Vec3::ZERO;
        if let Some(&sum) = self.lamp_sums.last() {
            let at = self.lamp_sums.partition_point(|&s| s <= random[0] * sum).min(self.lamps.len() - 1);
            let lamp = &self.lamps[at];
            let root = random[1].sqrt();
            let barycentric = [root * (1.0 - random[2]), root * random[2]];
            let [a, b, c] = lamp.corners;
            let point = a + (b - a) * barycentric[0] + (c - a) * barycentric[1];
            let to = point - surface.position;
            let (distance, direction) = (to.length(), to.normalize_or_zero());
            let normal = (b - a).cross(c - a).normalize_or_zero();
            let cosine = normal.dot(direction).abs();
            let value = scattered(surface, direction);
            if cosine > 0.0 && value.0 != Vec3::ZERO {
                let hit = lo_mesh::Hit { distance_m: distance, triangle: lamp.triangle, barycentric };
                let seen = self.world.interaction(&hit, &Ray { origin: surface.position, direction }, 0.0);
                let density = lamp.weight / sum / lamp.area_m2 * distance * distance / cosine;
                if seen.emission != Vec3::ZERO {
                    let weight = balance(density, value.1) / density;
                    let until = distance * (1.0 - 1e-4) - 1e-4;
                    light += value.0 * seen.emission * shadowed(direction, until) * weight;
                }
            }
        }
        if self.portal_area_m2 > 0.0 {
            light += self.portal_event(surface, [random[3], random[4], stream.random()], &shadowed);
        }
        if let Some(disc) = &self.world.sky.sun {
            let direction = disc.direction([random[5], random[6]]);
            let value = scattered(surface, direction).0;
            let open = self.world.sky.is_open(&Ray { origin: surface.position, direction }, self.world.far_m);
            if value != Vec3::ZERO && open {
                let radiance = Vec3::from(disc.sun.radiance) * disc.solid_angle_sr;
                light += value * radiance * shadowed(direction, self.world.far_m);
            }
        }
        light
    }

    fn portal_event(
        &self,
        surface: &SurfaceInteraction,
        random: [f32; 3],
        shadowed: &dyn Fn(Vec3, f32) -> Vec3,
    ) -> Vec3 {
        let mut wanted = random[0] * self.portal_area_m2;
        let portals = &self.world.sky.portals;
        let chosen = portals.iter().find(|opening| {
            wanted -= area(opening.portal.edges);
            wanted < 0.0
        });
        let Some(opening) = chosen.or(portals.last()) else { return Vec3::ZERO };
        let [a, b] = opening.portal.edges;
        let to = opening.portal.corner + a * random[1] + b * random[2] - surface.position;
        let direction = to.normalize_or_zero();
        let cosine = -direction.dot(opening.normal);
        let value = scattered(surface, direction);
        if cosine <= 0.0 || value.0 == Vec3::ZERO {
            return Vec3::ZERO;
        }
        let density = to.length_squared() / (cosine * self.portal_area_m2);
        let radiance = self.world.sky.radiance(direction) * shadowed(direction, self.world.far_m);
        value.0 * radiance * (balance(density, value.1) / density)
    }

    /// Returns the density per area with which points of a triangle are sampled as lights.
    fn lamp_density(&self, triangle: u32) -> f32 {
        let sum = self.lamp_sums.last().copied().unwrap_or(0.0);
        self.lamps
            .binary_search_by_key(&triangle, |lamp| lamp.triangle)
            .map_or(0.0, |at| self.lamps[at].weight / sum / self.lamps[at].area_m2)
    }
}

/// How a ray continues at a surface.
enum Continuation {
    /// Straight transmission.
    Straight,
    /// Mirror reflection, which has no density.
    Mirror,
    /// Sampled with a density per steradian, summed over all lobes that could have produced the direction.
    Scattered(f32),
}

/// Returns the sampling shares of transmission, mirror, diffuse, diffuse transmission and gloss.
fn shares(surface: &SurfaceInteraction) -> [f32; 5] {
    let glossy = if surface.is_glossy() {
        let cosine = surface.normal.dot(surface.view);
        lo_bsdf::specular_albedo(surface.f0, surface.roughness, cosine).max_element() * surface.coverage
    } else {
        0.0
    };
    let all = [surface.pass, surface.mirror, surface.diffuse, surface.through].map(Vec3::max_element);
    [all[0], all[1], all[2], all[3], glossy]
}

fn scatter(surface: &SurfaceInteraction, stream: &mut Stream) -> Option<(Ray, Vec3, Continuation)> {
    let shares = shares(surface);
    let sum: f32 = shares.iter().sum();
    if sum <= 0.0 {
        return None;
    }
    let mut wanted = stream.random::<f32>() * sum;
    let lobe = shares.iter().position(|share| {
        wanted -= share;
        wanted < 0.0
    })?;
    let random = Vec2::new(stream.random(), stream.random());
    let direction = match lobe {
        0 => return Some((surface.ray(-surface.view), surface.pass * (sum / shares[0]), Continuation::Straight)),
        1 => return Some((surface.ray(surface.mirrored()), surface.mirror * (sum / shares[1]), Continuation::Mirror)),
        2 => orthonormal_basis(surface.normal) * cosine_direction(stream),
        3 => orthonormal_basis(-surface.normal) * cosine_direction(stream),
        _ => {
            let basis = orthonormal_basis(surface.normal);
            basis * surface.ggx().sample(basis.transpose() * surface.view, random).light
        }
    };
    let (value, density) = scattered(surface, direction);
    if density <= 0.0 || value == Vec3::ZERO {
        return None;
    }
    Some((surface.ray(direction), value / density, Continuation::Scattered(density)))
}

/// Returns BSDF times cosine for light from `direction`, without transmission and mirror, and the density per steradian
/// with which [`scatter`] samples the direction.
fn scattered(surface: &SurfaceInteraction, direction: Vec3) -> (Vec3, f32) {
    let shares = shares(surface);
    let sum: f32 = shares.iter().sum();
    let (cosine, side) = (surface.normal.dot(direction), surface.geometric_normal.dot(direction));
    if cosine * side <= 0.0 || sum <= 0.0 {
        return (Vec3::ZERO, 0.0);
    }
    if cosine < 0.0 {
        return (surface.through * (-cosine / PI), shares[3] / sum * -cosine / PI);
    }
    let mut value = surface.diffuse * (cosine / PI);
    let mut density = shares[2] / sum * cosine / PI;
    if surface.is_glossy() {
        value += surface.gloss_cos(direction) * surface.coverage;
        density += shares[4] / sum * surface.gloss_pdf_per_sr(direction);
    }
    (value, density)
}

/// Returns the balance heuristic for one sample of each strategy.
fn balance(chosen: f32, other: f32) -> f32 {
    chosen / (chosen + other)
}

fn area([a, b]: [Vec3; 2]) -> f32 {
    a.cross(b).length()
}

/// Whether an offset from the corner, in the plane of the edges, is inside the parallelogram.
fn crosses([a, b]: [Vec3; 2], offset: Vec3) -> bool {
    let normal = a.cross(b);
    let scale = 1.0 / normal.length_squared();
    let (u, v) = (offset.cross(b).dot(normal) * scale, a.cross(offset).dot(normal) * scale);
    (0.0..=1.0).contains(&u) && (0.0..=1.0).contains(&v)
}

fn cosine_direction(stream: &mut Stream) -> Vec3 {
    let radius2: f32 = stream.random();
    let (sin, cos) = (TAU * stream.random::<f32>()).sin_cos();
    Vec3::new(radius2.sqrt() * cos, radius2.sqrt() * sin, (1.0 - radius2).sqrt())
}

/// Returns a white matte surface.
fn matte(position: Vec3, normal: Vec3) -> SurfaceInteraction {
    SurfaceInteraction {
        position,
        geometric_normal: normal,
        normal,
        view: normal,
        base_color: Vec3::ONE,
        diffuse: Vec3::ONE,
        through: Vec3::ZERO,
        f0: Vec3::ZERO,
        roughness: 1.0,
        pass: Vec3::ZERO,
        mirror: Vec3::ZERO,
        emission: Vec3::ZERO,
        coverage: 1.0,
        pane: false,
        triangle: u32::MAX,
    }
}
