//! Gather rays of each surfel: one pass finds which surfels see each other.

use std::f32::consts::PI;

use lo_geometry::{Ray, Vec3, orthonormal_basis};
use lo_mesh::offset_origin;
use rayon::prelude::*;

use crate::BakeSettings;
use crate::light_sampler::{DirectLight, LightCluster, LightSampler, limited};
use crate::lights::luminance;
use crate::pattern::{Rotations, shifted};
use crate::surfels::{Surfel, Surfels};
use crate::traced_world::{SurfaceInteraction, TracedWorld};
use crate::transfer;

/// Maximum number of mirrors and panes along a gather ray.
const MAX_MIRRORS: u32 = 8;

/// Limit of the light of mirrored lamps per ray, as a multiple of the mean irradiance. Few rays find them.
const MAX_MIRRORED: f32 = 1.0;

/// Largest distance that counts for the free space around a surfel, in metres.
const MAX_OPEN_M: f32 = 5.0;

/// Results of a surfel's gather rays.
#[derive(Default)]
pub(crate) struct GatherResult {
    /// Irradiance by lamps and glowing sheets: the gather rays' share of the multiple importance sampling.
    pub lamps: Vec3,
    /// Irradiance by everything that is neither a sampled light nor a surfel, plus corrections for secondary emitters.
    pub light: Vec3,
    /// Irradiance by mirrored lamps, up to a limit per ray.
    pub mirrored: Vec3,
    /// Irradiance beyond that limit.
    pub excess: Vec3,
    /// Rays that left the scene, but not through a portal.
    pub escaped: u32,
    /// Mean cubed distance to the hits, in m³: three times the visible free volume per steradian of projected solid
    /// angle.
    pub open_m3: f32,
    /// Mean inverse distance to the hits, per metre.
    pub nearness_per_m: f32,
    /// Surfels hit directly.
    pub links: Vec<u32>,
    /// Surfels hit through mirrors and panes, with the attenuation along the path.
    pub tinted: Vec<(u32, Vec3)>,
}

impl GatherResult {
    fn add_mirrored(&mut self, light: Vec3, max: f32) {
        let kept = limited(light, max);
        self.mirrored += kept;
        self.excess += light - kept;
    }
}

/// Secondary emitters, and the clusters with which they were sampled at a surfel.
struct SecondaryLights<'a> {
    lighting: &'a LightSampler<'a>,
    clusters: &'a [LightCluster],
}

/// Traces the gather rays of all surfels.
pub(crate) struct Gatherer<'a> {
    pub world: &'a TracedWorld,
    pub settings: &'a BakeSettings,
    pub rotations: &'a Rotations,
    pub pattern: Vec<Vec3>,
}

impl Gatherer<'_> {
    /// Traces the rays of all surfels. `lit` is the direct light found by light samples.
    pub(crate) fn gather(
        &self,
        surfels: &Surfels,
        lighting: &LightSampler,
        secondary: &LightSampler,
        lit: &[DirectLight],
    ) -> Vec<GatherResult> {
        // The limit on mirrored lamps is relative to the mean irradiance of matte surfaces.
        let max = MAX_MIRRORED * luminance(surfels.mean(|i| lit[i].irradiance + lit[i].sun));
        (0..lit.len())
            .into_par_iter()
            .map(|i| self.gather_surfel(surfels, lighting, secondary, &lit[i].clusters, i, max))
            .collect()
    }

    fn gather_surfel(
        &self,
        surfels: &Surfels,
        lighting: &LightSampler,
        secondary: &LightSampler,
        clusters: &[LightCluster],
        i: usize,
        max: f32,
    ) -> GatherResult {
        let surfel = &surfels.list[i];
        let rotation = self.rotations.of(i);
        let turn = lo_geometry::Mat3::from_rotation_z(std::f32::consts::TAU * rotation[3]);
        let basis = orthonormal_basis(surfel.normal) * turn;
        let origin = offset_origin(surfel.position, surfel.normal);
        let (rays, gather) = (self.settings.light_rays, self.settings.gather_rays);
        let reach = surfel.spacing_m;
        let lit = secondary.direct(self.world, surfel.position, surfel.normal, reach, rays, gather, rotation);
        let (secondary, sampled) = (SecondaryLights { lighting: secondary, clusters: &lit.clusters }, &lit);
        let mut result = GatherResult { links: Vec::with_capacity(self.pattern.len()), ..GatherResult::default() };
        for (k, &local) in self.pattern.iter().enumerate() {
            let ray = Ray { origin, direction: basis * local };
            let random = shifted(k as f32 * 0.618_034 % 1.0, rotation[0]);
            self.follow(surfels, lighting, clusters, &secondary, surfel, ray, local.z / PI, random, max, &mut result);
        }
        result.light *= PI / self.pattern.len() as f32;
        result.light += sampled.irradiance;
        result.mirrored *= PI / self.pattern.len() as f32;
        result.excess *= PI / self.pattern.len() as f32;
        result.lamps *= PI / self.pattern.len() as f32;
        result.open_m3 /= self.pattern.len() as f32;
        result.nearness_per_m /= self.pattern.len() as f32;
        result
    }

    #[expect(clippy::too_many_arguments, reason = "the state of one ray")]
    fn follow(
        &self,
        surfels: &Surfels,
        lighting: &LightSampler,
        clusters: &[LightCluster],
        secondary: &SecondaryLights,
        surfel: &Surfel,
        mut ray: Ray,
        density: f32,
        mut random: f32,
        max: f32,
        result: &mut GatherResult,
    ) {
        let start = ray;
        let mut run = ray;
        let mut first = true;
        let (mut tint, mut straight) = (Vec3::ONE, true);
        for _ in 0..MAX_MIRRORS {
            let Some(hit) = self.world.hit(&ray) else {
                let sky = &self.world.sky;
                let light = tint * sky.radiance(ray.direction);
                if !straight {
                    if sky.is_open(&run, self.world.far_m) {
                        result.add_mirrored(light, max);
                    }
                } else if !sky.exits_by_portal(&start, self.world.far_m) {
                    result.escaped += 1;
                    if sky.portals.is_empty() {
                        result.light += light;
                    }
                }
                return;
            };
            if std::mem::take(&mut first) {
                result.open_m3 += hit.distance_m.min(MAX_OPEN_M).powi(3);
                result.nearness_per_m += 1.0 / hit.distance_m.max(0.1 * surfel.spacing_m);
            }
            let surface = self.world.interaction(&hit, &ray, 0.0);
            let offset = surface.position - start.origin;
            let sr_per_m2 = surface.geometric_normal.dot(ray.direction).abs() / offset.length_squared().max(1e-12);
            // Share of an emitter's light that gather rays account for. Light samples account for the rest.
            let share = |lighting: &LightSampler, clusters: &[LightCluster], emitter: u32| {
                let other = lighting.density(clusters, emitter, start.origin, surfel.normal, sr_per_m2.max(1e-9));
                let own = self.pattern.len() as f32 * density;
                own / (own + other)
            };
            let emitter = lighting.emitters.of(&hit);
            if surface.emission != Vec3::ZERO {
                match emitter {
                    Some(emitter) if straight => {
                        result.lamps += tint * surface.emission * share(lighting, clusters, emitter)
                    }
                    None if straight => result.light += tint * surface.emission,
                    _ => result.add_mirrored(tint * surface.emission, max),
                }
            } else if let Some(emitter) = emitter.filter(|_| straight) {
                // A sheet lit from behind counts as a lamp. Its light is also in the surfel there, so it is subtracted.
                let light = lighting.emitters.radiance(emitter, surface.geometric_normal);
                result.lamps += tint * light * share(lighting, clusters, emitter);
                result.light -= tint * light;
            }
            if let Some(emitter) = secondary.lighting.emitters.of(&hit).filter(|_| straight) {
                let normal = surface.geometric_normal;
                let shines = secondary.lighting.emitters.radiance(emitter, normal) != Vec3::ZERO;
                let surfel_radiance = secondary.lighting.surfel_radiance.as_ref().filter(|_| shines);
                let light = surfel_radiance.map_or(Vec3::ZERO, |s| s.radiance(surface.position, normal, hit.triangle));
                result.light += tint * light * (share(secondary.lighting, secondary.clusters, emitter) - 1.0);
            }
            let [pass, mirror] = transfer::rays(&surface);
            if pass == Vec3::ZERO && mirror == Vec3::ZERO {
                return self.link(surfels, &surface, tint, result);
            }
            // Chooses one path in proportion to its share.
            let rest = surface.diffuse.max_element() + surface.through.max_element();
            let shares = [pass.max_element(), mirror.max_element(), rest];
            let sum: f32 = shares.iter().sum();
            if sum <= 0.0 {
                return;
            }
            random *= sum;
            if random < shares[0] {
                random /= shares[0];
                tint *= pass * (sum / shares[0]);
                ray = surface.ray(ray.direction);
            } else if random < shares[0] + shares[1] {
                random = (random - shares[0]) / shares[1];
                tint *= mirror * (sum / shares[1]);
                ray = surface.ray(surface.mirrored());
                run = ray;
                straight = false;
            } else {
                return self.link(surfels, &surface, tint * (sum / rest), result);
            }
            random = random.clamp(0.0, 1.0 - f32::EPSILON);
        }
    }

    fn link(&self, surfels: &Surfels, surface: &SurfaceInteraction, tint: Vec3, result: &mut GatherResult) {
        let component = surfels.component(surface.triangle);
        if let Some(surfel) = surfels.nearest(surface.position, surface.geometric_normal, component) {
            if tint == Vec3::ONE { result.links.push(surfel) } else { result.tinted.push((surfel, tint)) }
        }
    }
}
