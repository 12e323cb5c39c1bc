//! What the rays of each surfel find: one pass tells who sees whom.

use std::f32::consts::PI;

use lo_geometry::{Ray, Vec3, orthonormal_basis};
use lo_mesh::offset_origin;
use rayon::prelude::*;

use crate::BakeSettings;
use crate::light_sampler::{Direct, LightSampler, Part, limited};
use crate::lights::luminance;
use crate::pattern::{Rotations, shifted};
use crate::surfels::{Surfel, Surfels};
use crate::traced_world::{Surface, TracedWorld};
use crate::transfer;

/// Most mirrors and panes on the way of a gather ray.
const MAX_MIRRORS: u32 = 8;

/// Lamps in mirrors are no brighter to the cache than this many times the mean irradiance: few rays find them.
const MAX_MIRRORED: f32 = 1.0;

/// Free space farther away than this does not count for how open a surfel lies.
const MAX_OPEN_M: f32 = 5.0;

/// What the rays of a surfel found.
#[derive(Default)]
pub(crate) struct Row {
    /// Irradiance by lamps and glowing sheets, as far as light samples leave it to gather rays.
    pub lamps: Vec3,
    /// Irradiance by what is neither sampled as a light nor a surfel, and corrections for bright surfaces.
    pub light: Vec3,
    /// Irradiance by lamps in mirrors, up to a limit per ray.
    pub mirrored: Vec3,
    /// What went beyond that limit.
    pub excess: Vec3,
    /// Rays that left by no portal.
    pub escaped: u32,
    /// Mean cube of the distance to what the rays hit, metres³: three times the free space in view per steradian of projected
    /// solid angle.
    pub open_m3: f32,
    /// Mean inverse distance to what the rays hit, per metre.
    pub nearness_per_m: f32,
    /// Surfels hit directly.
    pub links: Vec<u32>,
    /// Surfels hit by way of mirrors and panes, with what these leave.
    pub tinted: Vec<(u32, Vec3)>,
}

impl Row {
    fn add_mirrored(&mut self, light: Vec3, most: f32) {
        let kept = limited(light, most);
        self.mirrored += kept;
        self.excess += light - kept;
    }
}

/// Surfaces so bright by direct light that they are sampled like lamps, and how they were at a surfel.
struct Bright<'a> {
    lighting: &'a LightSampler<'a>,
    parts: &'a [Part],
}

/// Sends the rays of all surfels.
pub(crate) struct Gatherer<'a> {
    pub world: &'a TracedWorld,
    pub settings: &'a BakeSettings,
    pub rotations: &'a Rotations,
    pub pattern: Vec<Vec3>,
}

impl Gatherer<'_> {
    /// What the rays of all surfels find; `lit` is what light samples found there.
    pub(crate) fn gather(
        &self,
        surfels: &Surfels,
        lighting: &LightSampler,
        bright: &LightSampler,
        lit: &[Direct],
    ) -> Vec<Row> {
        // Mirrored lamps are limited by what matte surfaces get on average.
        let most = MAX_MIRRORED * luminance(surfels.mean(|i| lit[i].irradiance + lit[i].sun));
        (0..lit.len()).into_par_iter().map(|i| self.row(surfels, lighting, bright, &lit[i].parts, i, most)).collect()
    }

    fn row(
        &self,
        surfels: &Surfels,
        lighting: &LightSampler,
        bright: &LightSampler,
        parts: &[Part],
        i: usize,
        most: f32,
    ) -> Row {
        let surfel = &surfels.list[i];
        let rotation = self.rotations.of(i);
        let turn = lo_geometry::Mat3::from_rotation_z(std::f32::consts::TAU * rotation[3]);
        let basis = orthonormal_basis(surfel.normal) * turn;
        let origin = offset_origin(surfel.position, surfel.normal);
        let (rays, gather) = (self.settings.light_rays, self.settings.gather_rays);
        let reach = surfel.spacing_m;
        let lit = bright.direct(self.world, surfel.position, surfel.normal, reach, rays, gather, rotation);
        let (bright, sampled) = (Bright { lighting: bright, parts: &lit.parts }, &lit);
        let mut row = Row { links: Vec::with_capacity(self.pattern.len()), ..Row::default() };
        for (k, &local) in self.pattern.iter().enumerate() {
            let ray = Ray { origin, direction: basis * local };
            let dice = shifted(k as f32 * 0.618_034 % 1.0, rotation[0]);
            self.follow(surfels, lighting, parts, &bright, surfel, ray, local.z / PI, dice, most, &mut row);
        }
        row.light *= PI / self.pattern.len() as f32;
        row.light += sampled.irradiance;
        row.mirrored *= PI / self.pattern.len() as f32;
        row.excess *= PI / self.pattern.len() as f32;
        row.lamps *= PI / self.pattern.len() as f32;
        row.open_m3 /= self.pattern.len() as f32;
        row.nearness_per_m /= self.pattern.len() as f32;
        row
    }

    #[expect(clippy::too_many_arguments, reason = "the state of one ray")]
    fn follow(
        &self,
        surfels: &Surfels,
        lighting: &LightSampler,
        parts: &[Part],
        bright: &Bright,
        surfel: &Surfel,
        mut ray: Ray,
        density: f32,
        mut dice: f32,
        most: f32,
        row: &mut Row,
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
                        row.add_mirrored(light, most);
                    }
                } else if !sky.leaves_by_portal(&start, self.world.far_m) {
                    row.escaped += 1;
                    if sky.portals.is_empty() {
                        row.light += light;
                    }
                }
                return;
            };
            if std::mem::take(&mut first) {
                row.open_m3 += hit.distance_m.min(MAX_OPEN_M).powi(3);
                row.nearness_per_m += 1.0 / hit.distance_m.max(0.1 * surfel.spacing_m);
            }
            let surface = self.world.surface(&hit, &ray, 0.0);
            let offset = surface.position - start.origin;
            let sr_per_m2 = surface.geometric_normal.dot(ray.direction).abs() / offset.length_squared().max(1e-12);
            // Share of the light of an emitter that gather rays answer for; the rest is light samples'.
            let share = |lighting: &LightSampler, parts: &[Part], emitter: u32| {
                let other = lighting.density(parts, emitter, start.origin, surfel.normal, sr_per_m2.max(1e-9));
                let own = self.pattern.len() as f32 * density;
                own / (own + other)
            };
            let emitter = lighting.emitters.of(&hit);
            if surface.emission != Vec3::ZERO {
                match emitter {
                    Some(emitter) if straight => row.lamps += tint * surface.emission * share(lighting, parts, emitter),
                    None if straight => row.light += tint * surface.emission,
                    _ => row.add_mirrored(tint * surface.emission, most),
                }
            } else if let Some(emitter) = emitter.filter(|_| straight) {
                // A sheet lit from behind: its light, which the surfel there has too, counts as a lamp's.
                let light = lighting.emitters.radiance(emitter, surface.geometric_normal);
                row.lamps += tint * light * share(lighting, parts, emitter);
                row.light -= tint * light;
            }
            if let Some(emitter) = bright.lighting.emitters.of(&hit).filter(|_| straight) {
                let normal = surface.geometric_normal;
                let shines = bright.lighting.emitters.radiance(emitter, normal) != Vec3::ZERO;
                let surfaces = bright.lighting.surfaces.as_ref().filter(|_| shines);
                let light = surfaces.map_or(Vec3::ZERO, |s| s.radiance(surface.position, normal, hit.triangle));
                row.light += tint * light * (share(bright.lighting, bright.parts, emitter) - 1.0);
            }
            let [pass, mirror] = transfer::rays(&surface);
            if pass == Vec3::ZERO && mirror == Vec3::ZERO {
                return self.link(surfels, &surface, tint, row);
            }
            // One way is chosen by its share.
            let rest = surface.diffuse.max_element() + surface.through.max_element();
            let shares = [pass.max_element(), mirror.max_element(), rest];
            let sum: f32 = shares.iter().sum();
            if sum <= 0.0 {
                return;
            }
            dice *= sum;
            if dice < shares[0] {
                dice /= shares[0];
                tint *= pass * (sum / shares[0]);
                ray = surface.ray(ray.direction);
            } else if dice < shares[0] + shares[1] {
                dice = (dice - shares[0]) / shares[1];
                tint *= mirror * (sum / shares[1]);
                ray = surface.ray(surface.mirrored());
                run = ray;
                straight = false;
            } else {
                return self.link(surfels, &surface, tint * (sum / rest), row);
            }
            dice = dice.clamp(0.0, 1.0 - f32::EPSILON);
        }
    }

    fn link(&self, surfels: &Surfels, surface: &Surface, tint: Vec3, row: &mut Row) {
        let part = surfels.part(surface.triangle);
        if let Some(surfel) = surfels.nearest(surface.position, surface.geometric_normal, part) {
            if tint == Vec3::ONE { row.links.push(surfel) } else { row.tinted.push((surfel, tint)) }
        }
    }
}
