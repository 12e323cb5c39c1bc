//! Shading of one pixel: a few samples of lamps and portals, the sun, a ray into the gloss, the rest from the cache.

use std::f32::consts::PI;

use lo_bsdf::fresnel;
use lo_geometry::{Ray, Vec2, Vec3, orthonormal_basis, van_der_corput};

use crate::View;
use crate::baked::BakedWorld;
use crate::gbuffer::{Facet, GBufferSample, trace_view_ray};
use crate::light_sampler::LightCluster;
use crate::light_tree::{CutNode, GlossyLobe};
use crate::lights::luminance;
use crate::neighbours::Neighbours;
use crate::pattern::{Rotations, r2, radical_inverse_3, shifted};
use crate::traced_world::SurfaceInteraction;

/// Below this roughness, gloss is no wider than a few pixels and treated as a mirror. Above it, lamps are sampled for
/// the gloss.
const MIRROR_ROUGHNESS: f32 = 0.12;

/// From this roughness on, gloss is wide: lamps are sampled for it together with the diffuse light.
const WIDE_ROUGHNESS: f32 = 0.5;

/// Gloss with α below this many pixels (in radians) would be blurred by sharing it between pixels.
const MIN_SHARED_ALPHA_PX: f32 = 2.0;

/// Minimum rays into such gloss.
const MIN_GLOSS_RAYS: u32 = 6;

/// Light samples per mirror ray.
const SAMPLES_PER_MIRROR_RAY: u32 = 4;

/// Specular reflectance from which wide gloss is worth a ray. Plastic, wood and plaster reflect the mean ambient light.
const MIN_RAY_F0: f32 = 0.2;

/// Largest difference of reflectance and roughness together at which two surfaces count as one.
const SAME_GLOSS: f32 = 0.1;

/// Reflected lamps below this share of the surface's other radiance are sampled with reduced probability.
const MIN_REFLECTED: f32 = 0.05;

/// Minimum of that probability.
const MIN_PROBABILITY: f32 = 0.1;

/// Side of the pixel tile after which the sample pattern repeats.
const TILE_PX: usize = 4;

/// Order of the pixels within a tile. Neighbours take distant samples (Bayer 1973).
const TILE_ORDER: [u32; TILE_PX * TILE_PX] = [0, 8, 2, 10, 12, 4, 14, 6, 3, 11, 1, 9, 15, 7, 13, 5];

/// Light on the surface of a pixel.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct PixelLight {
    /// Irradiance by lamps and portals.
    pub lamps: Vec3,
    /// Irradiance by the sun.
    pub sun: Vec3,
    /// Irradiance by everything else.
    pub indirect: Vec3,
    /// Irradiance on the other side.
    pub behind: Vec3,
    /// Radiance reflected by the gloss, divided by its albedo.
    gloss: Vec3,
    /// Radiance of the sun reflected by the gloss, divided by its albedo.
    sun_gloss: Vec3,
    /// Whether the gloss is too sharp to be shared between pixels.
    is_sharp: bool,
    /// Variance of [`PixelLight::brightness`], where this is a mean over pixels.
    pub variance: f32,
}

impl PixelLight {
    /// Returns a copy without the light that pixels share.
    pub(crate) fn without_shared(&self) -> Self {
        Self {
            lamps: Vec3::ZERO,
            behind: Vec3::ZERO,
            gloss: if self.is_sharp { self.gloss } else { Vec3::ZERO },
            ..*self
        }
    }

    pub(crate) fn add(&mut self, other: &Self, weight: f32) {
        self.lamps += other.lamps * weight;
        self.behind += other.behind * weight;
        if !self.is_sharp {
            self.gloss += other.gloss * weight;
        }
    }

    /// Returns how likely the difference of two means is due to noise, 0 to 1.
    pub(crate) fn likeness(&self, other: &Self) -> f32 {
        /// Relative difference that is not visible.
        const SAME: f32 = 0.05;
        let (a, b) = (self.brightness(), other.brightness());
        let same = SAME * (a + b);
        (-0.5 * (a - b).powi(2) / (self.variance + other.variance + same * same).max(1e-18)).exp()
    }

    /// Returns the luminance of the light that pixels share.
    pub(crate) fn brightness(&self) -> f32 {
        luminance(self.lamps) + luminance(self.gloss)
    }

    pub(crate) fn divide(&mut self, by: f32) {
        self.lamps /= by;
        self.behind /= by;
        if !self.is_sharp {
            self.gloss /= by;
        }
    }

    /// Blends the shared light with the pixel's own samples.
    pub(crate) fn mix(&mut self, own: &Self, weight: f32, own_weight: f32) {
        let share = own_weight / (weight + own_weight);
        self.lamps = self.lamps.lerp(own.lamps, share);
        self.behind = self.behind.lerp(own.behind, share);
        self.gloss = self.gloss.lerp(own.gloss, share);
    }

    /// Returns the radiance reflected by the gloss.
    pub(crate) fn reflected(&self, surface: &SurfaceInteraction) -> Vec3 {
        (self.gloss + self.sun_gloss) * gloss_albedo(surface)
    }
}

fn gloss_albedo(surface: &SurfaceInteraction) -> Vec3 {
    lo_bsdf::specular_albedo(surface.f0, surface.roughness, surface.normal.dot(surface.view))
}

/// Divides radiance reflected by the gloss by its albedo.
fn per_albedo(surface: &SurfaceInteraction, reflected: Vec3) -> Vec3 {
    reflected / gloss_albedo(surface).max(Vec3::splat(1e-6))
}

/// Samples a direction of the glossy lobe and its weight. `None` if it points below the surface.
fn sample_gloss(surface: &SurfaceInteraction, random: Vec2) -> Option<(Vec3, Vec3)> {
    let basis = orthonormal_basis(surface.normal);
    let sample = surface.ggx().sample(basis.transpose() * surface.view, random);
    let (direction, weight) = (basis * sample.light, fresnel(surface.f0, sample.v_dot_h) * sample.weight);
    (weight != Vec3::ZERO && direction.dot(surface.geometric_normal) > 0.0).then_some((direction, weight))
}

/// Samples light at pixels of a baked world.
pub(crate) struct PixelSampler<'a> {
    baked: &'a BakedWorld,
    view: &'a View,
    rotations: Rotations,
}

/// Returns the index of a pixel's samples within the pattern of its tile.
fn tile_index((x, y): (usize, usize)) -> u32 {
    TILE_ORDER[(y % TILE_PX) * TILE_PX + x % TILE_PX]
}

impl<'a> PixelSampler<'a> {
    pub(crate) fn new(baked: &'a BakedWorld, view: &'a View) -> Self {
        Self { baked, view, rotations: Rotations::new("transport view", baked.settings().seed) }
    }

    /// Samples light at a pixel with `rays` light samples, which are part of a pattern over its tile.
    pub(crate) fn sample(&self, view_sample: &GBufferSample, at: (usize, usize), rays: u32) -> PixelLight {
        let Some(surface) = &view_sample.surface else { return PixelLight::default() };
        let cache = self.baked.cache();
        let tile_index = tile_index(at);
        let near =
            cache.surfels.near(surface.position, surface.geometric_normal, cache.surfels.component(surface.triangle));
        let mut lit = PixelLight { indirect: near.mean(|surfel| cache.indirect[surfel]), ..PixelLight::default() };
        let jitter = self.rotations.of(at.0 / TILE_PX * 59 + at.1 / TILE_PX * 997);
        if surface.through != Vec3::ZERO {
            let back =
                SurfaceInteraction { geometric_normal: -surface.geometric_normal, normal: -surface.normal, ..*surface };
            let near = cache.surfels.near(back.position, back.geometric_normal, cache.surfels.component(back.triangle));
            let (lamps, _) = self.lamps(&back, &near, tile_index, rays, jitter);
            let (sun, _) = self.sun(&back, tile_index);
            lit.behind = near.mean(|surfel| cache.indirect[surfel]) + lamps + sun;
        }
        if surface.diffuse != Vec3::ZERO || surface.is_glossy() {
            let (diffuse, rough) = self.lamps(surface, &near, tile_index, rays, jitter);
            lit.lamps = diffuse;
            let (diffuse, gloss) = self.sun(surface, tile_index);
            lit.sun = diffuse;
            lit.sun_gloss = per_albedo(surface, gloss);
            if surface.is_glossy() {
                match surface.roughness {
                    ..MIRROR_ROUGHNESS => self.mirror(surface, at, rays, &mut lit),
                    MIRROR_ROUGHNESS..WIDE_ROUGHNESS => {
                        self.blurred_gloss(view_sample, surface, at, rays, jitter, &mut lit)
                    }
                    _ => self.wide_gloss(surface, tile_index, rough, &mut lit),
                }
            }
        }
        lit
    }

    /// Samples lamps and portals at a pixel. Returns the irradiance, and the radiance that wide gloss reflects.
    fn lamps(
        &self,
        surface: &SurfaceInteraction,
        near: &Neighbours,
        tile_index: u32,
        rays: u32,
        jitter: [f32; 4],
    ) -> (Vec3, Vec3) {
        let fresh;
        let clusters = match near.best() {
            Some(surfel) => self.baked.cache().clusters(surfel),
            None => {
                fresh = self.clusters_at(surface);
                &fresh
            }
        };
        let samples = rays * (TILE_PX * TILE_PX) as u32;
        let sample = |k: u32| self.lamp(surface, clusters, tile_index * rays + k, samples, jitter);
        let add = |sum: (Vec3, Vec3), (diffuse, gloss): (Vec3, Vec3)| (sum.0 + diffuse, sum.1 + gloss);
        let (diffuse, gloss) = (0..rays).map(sample).fold((Vec3::ZERO, Vec3::ZERO), add);
        (diffuse / rays as f32, gloss / rays as f32)
    }

    /// Shades gloss between mirror and wide. Rays into the gloss and samples of lamps are combined by the balance
    /// heuristic (Veach & Guibas 1995).
    fn blurred_gloss(
        &self,
        view_sample: &GBufferSample,
        surface: &SurfaceInteraction,
        at: (usize, usize),
        rays: u32,
        jitter: [f32; 4],
        lit: &mut PixelLight,
    ) {
        let tile_index = tile_index(at);
        let is_shared =
            surface.ggx().alpha() * view_sample.travelled_m >= MIN_SHARED_ALPHA_PX * view_sample.footprint_m;
        let count = if is_shared { rays.div_ceil(2) } else { rays.max(MIN_GLOSS_RAYS) };
        let shown = luminance(surface.diffuse * (lit.lamps + lit.indirect)) / PI;
        let lighting = &self.baked.cache().lighting;
        let mut sum = Vec3::ZERO;
        for k in 0..count {
            // Stratified over the pixel's own samples first, then over its tile.
            let first = (k as f32 + (tile_index as f32 + 0.5) / (TILE_PX * TILE_PX) as f32) / count as f32;
            let second = shifted(van_der_corput(k), van_der_corput(tile_index));
            let third = shifted(radical_inverse_3(k), radical_inverse_3(tile_index));
            let random = [shifted(first, jitter[0]), shifted(second, jitter[1]), shifted(third, jitter[2])];
            let surface = if is_shared { *surface } else { self.surface_within(surface, at, k) };
            let random_test = shifted(r2(tile_index).x, shifted(r2(k).y, jitter[3]));
            sum += self.reflected_light(&surface, shown, random, random_test);
            let Some((direction, weight)) = sample_gloss(&surface, Vec2::new(random[1], random[0])) else { continue };
            let own = surface.gloss_pdf_per_sr(direction);
            let reflected = GlossyLobe { mirrored: surface.mirrored(), ggx: surface.ggx() };
            let ray = surface.ray(direction);
            let start = surface.ray(surface.geometric_normal).origin;
            let share = |emitter: u32, sr_per_m2: f32| {
                if lighting.emitters.list[emitter as usize].sheet {
                    return 1.0;
                }
                let other = lighting.density_reflected(emitter, start, surface.normal, &reflected, sr_per_m2);
                own / (own + other)
            };
            sum += weight * self.baked.light_beside_samples(ray, share);
        }
        lit.gloss = per_albedo(surface, sum / count as f32);
        lit.is_sharp = !is_shared;
    }

    /// Traces ray `k` within a pixel. Returns its surface if it continues that of the pixel's centre, else the
    /// centre's.
    fn surface_within(&self, surface: &SurfaceInteraction, (x, y): (usize, usize), k: u32) -> SurfaceInteraction {
        let within = r2(k);
        let view_sample = trace_view_ray(self.baked, self.view, x as f32 + within.x, y as f32 + within.y);
        let same = |other: &SurfaceInteraction| {
            // A thin object may lie on another one with the same facing.
            let gloss = (other.f0 - surface.f0).abs().max_element() + (other.roughness - surface.roughness).abs();
            gloss < SAME_GLOSS && Facet::of(surface).is_like(view_sample.footprint_m, &Facet::of(other))
        };
        view_sample.surface.filter(same).unwrap_or(*surface)
    }

    /// Shades a mirror.
    fn mirror(&self, surface: &SurfaceInteraction, at: (usize, usize), rays: u32, lit: &mut PixelLight) {
        let count = rays.div_ceil(SAMPLES_PER_MIRROR_RAY);
        for k in 0..count {
            let surface = if count > 1 { self.surface_within(surface, at, k) } else { *surface };
            let light = self.baked.light_along(surface.ray(surface.mirrored()));
            lit.gloss += light / count as f32;
        }
        lit.is_sharp = true;
    }

    /// Shades wide gloss, given the radiance it reflects of lamps and portals, which are sampled with the diffuse
    /// light.
    fn wide_gloss(&self, surface: &SurfaceInteraction, tile_index: u32, lamps: Vec3, lit: &mut PixelLight) {
        if surface.f0.max_element() < MIN_RAY_F0 {
            lit.gloss = per_albedo(surface, lamps) + lit.indirect / PI;
            return;
        }
        let random = Vec2::new(van_der_corput(tile_index), (tile_index as f32 + 0.5) / (TILE_PX * TILE_PX) as f32);
        let ray = sample_gloss(surface, random).map_or(Vec3::ZERO, |(direction, weight)| {
            weight * self.baked.light_beside_samples(surface.ray(direction), |_, _| 0.0)
        });
        lit.gloss = per_albedo(surface, lamps + ray);
    }

    /// Takes light sample `index` of `samples`. Returns the irradiance, and the radiance that wide gloss reflects.
    fn lamp(
        &self,
        surface: &SurfaceInteraction,
        clusters: &[LightCluster],
        index: u32,
        samples: u32,
        jitter: [f32; 4],
    ) -> (Vec3, Vec3) {
        let wanted = (index as f32 + jitter[0]) / samples as f32;
        let Some(at) =
            clusters.iter().position(|cluster| wanted < cluster.cumulative).or(clusters.len().checked_sub(1))
        else {
            return (Vec3::ZERO, Vec3::ZERO);
        };
        let before = at.checked_sub(1).map_or(0.0, |at| clusters[at].cumulative);
        let probability = clusters[at].cumulative - before;
        if probability <= 0.0 {
            return (Vec3::ZERO, Vec3::ZERO);
        }
        let random = [
            (wanted - before) / probability,
            shifted(van_der_corput(index), jitter[1]),
            shifted(radical_inverse_3(index), jitter[2]),
        ];
        let lighting = &self.baked.cache().lighting;
        let world = self.baked.world();
        let start = surface.ray(surface.geometric_normal).origin;
        let Some((light, density)) =
            lighting.sample(world, start, surface.normal, clusters[at].node, random, probability)
        else {
            return (Vec3::ZERO, Vec3::ZERO);
        };
        if light.direction.dot(surface.geometric_normal) <= 0.0 {
            return (Vec3::ZERO, Vec3::ZERO);
        }
        let passed = world.transmittance(&Ray { origin: start, direction: light.direction }, light.distance_m);
        let arriving = light.radiance * passed / density;
        let gloss = if surface.is_glossy() && surface.roughness >= WIDE_ROUGHNESS {
            arriving * surface.gloss_cos(light.direction)
        } else {
            Vec3::ZERO
        };
        (arriving * surface.normal.dot(light.direction), gloss)
    }

    /// Samples lamps and portals reflected by gloss: the light samples' share of the balance heuristic. `shown` is the
    /// surface's other luminance. Curtains are large enough for the rays into the gloss to find.
    fn reflected_light(&self, surface: &SurfaceInteraction, shown: f32, random: [f32; 3], random_test: f32) -> Vec3 {
        let (lighting, world) = (&self.baked.cache().lighting, self.baked.world());
        let start = surface.ray(surface.geometric_normal).origin;
        let reflected = GlossyLobe { mirrored: surface.mirrored(), ggx: surface.ggx() };
        let sample = lighting.sample_reflected(world, start, surface.normal, &reflected, random);
        let Some((light, density)) = sample.filter(|(light, _)| !light.sheet) else { return Vec3::ZERO };
        if light.direction.dot(surface.geometric_normal) <= 0.0 {
            return Vec3::ZERO;
        }
        let gloss = surface.gloss_cos(light.direction);
        let by_gloss = surface.gloss_pdf_per_sr(light.direction);
        let reflected = light.radiance * gloss / (density + by_gloss);
        if reflected == Vec3::ZERO {
            return Vec3::ZERO;
        }
        // Most lamps are off the lobe. Few shadow rays test them.
        let probability = (luminance(reflected) / (MIN_REFLECTED * shown)).clamp(MIN_PROBABILITY, 1.0);
        if random_test >= probability {
            return Vec3::ZERO;
        }
        let passed = world.transmittance(&Ray { origin: start, direction: light.direction }, light.distance_m);
        reflected * passed / probability
    }

    /// Recomputes the sun's light for a ray within a pixel, for sample `number` of the pixel.
    pub(crate) fn resample_sun(
        &self,
        view_sample: &GBufferSample,
        at: (usize, usize),
        number: usize,
        lit: &mut PixelLight,
    ) {
        let Some(surface) = &view_sample.surface else { return };
        let tile_index = (tile_index(at) + 5 * number as u32) % (TILE_PX * TILE_PX) as u32;
        let (diffuse, gloss) = self.sun(surface, tile_index);
        lit.sun = diffuse;
        lit.sun_gloss = per_albedo(surface, gloss);
    }

    /// Samples the sun. Returns its irradiance and the radiance that the gloss reflects.
    fn sun(&self, surface: &SurfaceInteraction, tile_index: u32) -> (Vec3, Vec3) {
        let world = self.baked.world();
        let Some(disc) = &world.sky.sun else { return (Vec3::ZERO, Vec3::ZERO) };
        let direction =
            disc.direction([(tile_index as f32 + 0.5) / (TILE_PX * TILE_PX) as f32, van_der_corput(tile_index)]);
        let cosine = surface.normal.dot(direction);
        let ray = surface.ray(direction);
        let may_come = world.sky.is_open(&ray, world.far_m);
        if cosine <= 0.0 || direction.dot(surface.geometric_normal) <= 0.0 || !may_come {
            return (Vec3::ZERO, Vec3::ZERO);
        }
        let radiance = Vec3::from(disc.sun.radiance) * world.transmittance(&ray, world.far_m) * disc.solid_angle_sr;
        let gloss = if surface.is_glossy() { surface.gloss_cos(direction) } else { Vec3::ZERO };
        (radiance * cosine, radiance * gloss)
    }

    /// Computes light clusters where no surfel provides them.
    fn clusters_at(&self, surface: &SurfaceInteraction) -> Vec<LightCluster> {
        let mut cut: Vec<CutNode> = Vec::new();
        let tree = &self.baked.cache().lighting.tree;
        tree.cut(surface.position, surface.normal, 0.0, crate::light_sampler::MAX_CLUSTERS, &mut cut);
        let total: f32 = cut.iter().map(|cluster| cluster.importance).sum();
        let mut running = 0.0;
        cut.iter()
            .map(|cluster| {
                running += cluster.importance / total;
                LightCluster { node: cluster.node, samples: 1.0, cumulative: running }
            })
            .collect()
    }
}
