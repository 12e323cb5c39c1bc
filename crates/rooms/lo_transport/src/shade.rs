//! Light at one pixel: a few samples of lamps and portals, the sun, a ray into the gloss, the rest from the cache.

use std::f32::consts::PI;

use lo_bsdf::fresnel;
use lo_geometry::{Ray, Vec2, Vec3, orthonormal_basis, van_der_corput};

use crate::View;
use crate::baked::BakedWorld;
use crate::gbuffer::{Facet, Seen, look};
use crate::light_sampler::Part;
use crate::light_tree::{CutNode, Gloss};
use crate::lights::luminance;
use crate::neighbours::Neighbours;
use crate::pattern::{Rotations, r2, radical_inverse_3, shifted};
use crate::traced_world::Surface;

/// Below this roughness gloss is no wider than a few pixels: a mirror. From it on lamps are sampled for the gloss.
const SHARP: f32 = 0.12;

/// From this roughness on gloss is wide: lamps are sampled for it together with the diffuse light.
const BLURRED: f32 = 0.5;

/// Gloss whose α is below this many pixels (in radians) would be blurred by sharing what it shows with other pixels.
const SHARED_GLOSS: f32 = 2.0;

/// Rays into such gloss, at least.
const MIN_GLOSS_RAYS: u32 = 6;

/// Mirrors trace one ray for so many light samples.
const MIRROR_SHARE: u32 = 4;

/// Specular reflectance from which wide gloss is worth a ray. That of plastics, wood and plaster sees the mean light around.
const METAL: f32 = 0.2;

/// Surfaces whose reflectance and roughness together differ by less are one.
const LIKE_GLOSS: f32 = 0.1;

/// Reflected lamps below this share of what else a surface shows are looked for by chance,
const MIN_REFLECTED: f32 = 0.05;

/// which is at least this.
const MIN_CHANCE: f32 = 0.1;

/// Side of the square of pixels after which the samples repeat.
const TILE: usize = 4;

/// Order of the pixels of a tile: neighbours take distant samples (Bayer 1973).
const ORDER: [u32; TILE * TILE] = [0, 8, 2, 10, 12, 4, 14, 6, 3, 11, 1, 9, 15, 7, 13, 5];

/// Light on the surface of a pixel.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Lit {
    /// Irradiance by lamps and portals.
    pub lamps: Vec3,
    /// Irradiance by the sun.
    pub sun: Vec3,
    /// Irradiance by all else.
    pub indirect: Vec3,
    /// Irradiance on the other side.
    pub behind: Vec3,
    /// Light reflected by the gloss, divided by the gloss's albedo.
    gloss: Vec3,
    /// The same of the sun.
    sun_gloss: Vec3,
    /// Others' gloss would blur what its own shows.
    is_sharp: bool,
    /// Variance of [`Lit::brightness`], where it is a mean over pixels.
    pub variance: f32,
}

impl Lit {
    /// Itself without what pixels share.
    pub(crate) fn nothing(&self) -> Self {
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

    /// How far two means that differ by this much may differ by chance alone, 0 to 1.
    pub(crate) fn likeness(&self, other: &Self) -> f32 {
        /// Relative difference that does not show.
        const SAME: f32 = 0.05;
        let (a, b) = (self.brightness(), other.brightness());
        let same = SAME * (a + b);
        (-0.5 * (a - b).powi(2) / (self.variance + other.variance + same * same).max(1e-18)).exp()
    }

    /// Luminance of what pixels share.
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

    /// Mean of what pixels share and own samples.
    pub(crate) fn mix(&mut self, own: &Self, weight: f32, own_weight: f32) {
        let share = own_weight / (weight + own_weight);
        self.lamps = self.lamps.lerp(own.lamps, share);
        self.behind = self.behind.lerp(own.behind, share);
        self.gloss = self.gloss.lerp(own.gloss, share);
    }

    /// Light that the gloss reflects.
    pub(crate) fn reflected(&self, surface: &Surface) -> Vec3 {
        (self.gloss + self.sun_gloss) * gloss_albedo(surface)
    }
}

fn gloss_albedo(surface: &Surface) -> Vec3 {
    lo_bsdf::specular_albedo(surface.f0, surface.roughness, surface.normal.dot(surface.view))
}

/// Light that the gloss reflects, divided by its albedo.
fn per_albedo(surface: &Surface, reflected: Vec3) -> Vec3 {
    reflected / gloss_albedo(surface).max(Vec3::splat(1e-6))
}

/// A direction into the gloss, and what multiplies its radiance in a plain mean; nothing where it points below the surface.
fn into_gloss(surface: &Surface, random: Vec2) -> Option<(Vec3, Vec3)> {
    let basis = orthonormal_basis(surface.normal);
    let sample = surface.ggx().sample(basis.transpose() * surface.view, random);
    let (direction, weight) = (basis * sample.light, fresnel(surface.f0, sample.v_dot_h) * sample.weight);
    (weight != Vec3::ZERO && direction.dot(surface.geometric_normal) > 0.0).then_some((direction, weight))
}

/// Samples light at pixels of a baked world.
pub(crate) struct Sampler<'a> {
    baked: &'a BakedWorld,
    view: &'a View,
    rotations: Rotations,
}

/// The place of a pixel's samples in the pattern of its tile.
fn turn((x, y): (usize, usize)) -> u32 {
    ORDER[(y % TILE) * TILE + x % TILE]
}

impl<'a> Sampler<'a> {
    pub(crate) fn new(baked: &'a BakedWorld, view: &'a View) -> Self {
        Self { baked, view, rotations: Rotations::new("transport view", baked.settings().seed) }
    }

    /// Light at a pixel from `rays` light samples, which are part of a pattern over the tile of pixels around.
    pub(crate) fn sample(&self, seen: &Seen, at: (usize, usize), rays: u32) -> Lit {
        let Some(surface) = &seen.surface else { return Lit::default() };
        let cache = self.baked.cache();
        let turn = turn(at);
        let near = cache.surfels.near(surface.position, surface.geometric_normal, cache.surfels.part(surface.triangle));
        let mut lit = Lit { indirect: near.mean(|surfel| cache.indirect[surfel]), ..Lit::default() };
        let jitter = self.rotations.of(at.0 / TILE * 59 + at.1 / TILE * 997);
        if surface.through != Vec3::ZERO {
            let back = Surface { geometric_normal: -surface.geometric_normal, normal: -surface.normal, ..*surface };
            let near = cache.surfels.near(back.position, back.geometric_normal, cache.surfels.part(back.triangle));
            let (lamps, _) = self.lamps(&back, &near, turn, rays, jitter);
            let (sun, _) = self.sun(&back, turn);
            lit.behind = near.mean(|surfel| cache.indirect[surfel]) + lamps + sun;
        }
        if surface.diffuse != Vec3::ZERO || surface.is_glossy() {
            let (diffuse, rough) = self.lamps(surface, &near, turn, rays, jitter);
            lit.lamps = diffuse;
            let (diffuse, gloss) = self.sun(surface, turn);
            lit.sun = diffuse;
            lit.sun_gloss = per_albedo(surface, gloss);
            if surface.is_glossy() {
                match surface.roughness {
                    ..SHARP => self.mirror(surface, at, rays, &mut lit),
                    SHARP..BLURRED => self.blurred_gloss(seen, surface, at, rays, jitter, &mut lit),
                    _ => self.wide_gloss(surface, turn, rough, &mut lit),
                }
            }
        }
        lit
    }

    /// Light of lamps and portals at a pixel: irradiance, and what a rough gloss reflects of it.
    fn lamps(&self, surface: &Surface, near: &Neighbours, turn: u32, rays: u32, jitter: [f32; 4]) -> (Vec3, Vec3) {
        let fresh;
        let parts = match near.best() {
            Some(surfel) => self.baked.cache().parts(surfel),
            None => {
                fresh = self.fresh_parts(surface);
                &fresh
            }
        };
        let samples = rays * (TILE * TILE) as u32;
        let sample = |k: u32| self.lamp(surface, parts, turn * rays + k, samples, jitter);
        let add = |sum: (Vec3, Vec3), (diffuse, gloss): (Vec3, Vec3)| (sum.0 + diffuse, sum.1 + gloss);
        let (diffuse, gloss) = (0..rays).map(sample).fold((Vec3::ZERO, Vec3::ZERO), add);
        (diffuse / rays as f32, gloss / rays as f32)
    }

    /// Gloss that is neither a mirror's nor so wide that it sees the mean light around: by rays into it and by samples of lamps, weighed by the balance heuristic where both find a lamp (Veach & Guibas 1995).
    fn blurred_gloss(
        &self,
        seen: &Seen,
        surface: &Surface,
        at: (usize, usize),
        rays: u32,
        jitter: [f32; 4],
        lit: &mut Lit,
    ) {
        let turn = turn(at);
        let is_shared = surface.ggx().alpha() * seen.travelled_m >= SHARED_GLOSS * seen.footprint_m;
        let count = if is_shared { rays.div_ceil(2) } else { rays.max(MIN_GLOSS_RAYS) };
        let shown = luminance(surface.diffuse * (lit.lamps + lit.indirect)) / PI;
        let lighting = &self.baked.cache().lighting;
        let mut sum = Vec3::ZERO;
        for k in 0..count {
            // Spread over the pixel's own samples first, then over its tile.
            let first = (k as f32 + (turn as f32 + 0.5) / (TILE * TILE) as f32) / count as f32;
            let second = shifted(van_der_corput(k), van_der_corput(turn));
            let third = shifted(radical_inverse_3(k), radical_inverse_3(turn));
            let random = [shifted(first, jitter[0]), shifted(second, jitter[1]), shifted(third, jitter[2])];
            let surface = if is_shared { *surface } else { self.elsewhere(surface, at, k) };
            let dice = shifted(r2(turn).x, shifted(r2(k).y, jitter[3]));
            sum += self.reflected_light(&surface, shown, random, dice);
            let Some((direction, weight)) = into_gloss(&surface, Vec2::new(random[1], random[0])) else { continue };
            let own = surface.gloss_pdf_per_sr(direction);
            let reflected = Gloss { mirrored: surface.mirrored(), ggx: surface.ggx() };
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

    /// What ray `k` within a pixel sees of the surface that the ray through its middle sees; the latter where it sees another one.
    fn elsewhere(&self, surface: &Surface, (x, y): (usize, usize), k: u32) -> Surface {
        let within = r2(k);
        let seen = look(self.baked, self.view, x as f32 + within.x, y as f32 + within.y);
        let same = |other: &Surface| {
            // A thin thing may lie on another one that faces the same way.
            let gloss = (other.f0 - surface.f0).abs().max_element() + (other.roughness - surface.roughness).abs();
            gloss < LIKE_GLOSS && Facet::of(surface).is_like(seen.footprint_m, &Facet::of(other))
        };
        seen.surface.filter(same).unwrap_or(*surface)
    }

    /// Gloss of a mirror.
    fn mirror(&self, surface: &Surface, at: (usize, usize), rays: u32, lit: &mut Lit) {
        let count = rays.div_ceil(MIRROR_SHARE);
        for k in 0..count {
            let surface = if count > 1 { self.elsewhere(surface, at, k) } else { *surface };
            let light = self.baked.light_along(surface.ray(surface.mirrored()));
            lit.gloss += light / count as f32;
        }
        lit.is_sharp = true;
    }

    /// Wide gloss, given what it reflects of lamps and portals: these are sampled with the diffuse ones.
    fn wide_gloss(&self, surface: &Surface, turn: u32, lamps: Vec3, lit: &mut Lit) {
        if surface.f0.max_element() < METAL {
            lit.gloss = per_albedo(surface, lamps) + lit.indirect / PI;
            return;
        }
        let random = Vec2::new(van_der_corput(turn), (turn as f32 + 0.5) / (TILE * TILE) as f32);
        let ray = into_gloss(surface, random).map_or(Vec3::ZERO, |(direction, weight)| {
            weight * self.baked.light_beside_samples(surface.ray(direction), |_, _| 0.0)
        });
        lit.gloss = per_albedo(surface, lamps + ray);
    }

    /// Light sample number `index` of `samples`: irradiance, and light that the gloss reflects.
    fn lamp(&self, surface: &Surface, parts: &[Part], index: u32, samples: u32, jitter: [f32; 4]) -> (Vec3, Vec3) {
        let wanted = (index as f32 + jitter[0]) / samples as f32;
        let Some(at) = parts.iter().position(|part| wanted < part.cumulative).or(parts.len().checked_sub(1)) else {
            return (Vec3::ZERO, Vec3::ZERO);
        };
        let before = at.checked_sub(1).map_or(0.0, |at| parts[at].cumulative);
        let probability = parts[at].cumulative - before;
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
        let Some((light, density)) = lighting.sample(world, start, surface.normal, parts[at].node, random, probability)
        else {
            return (Vec3::ZERO, Vec3::ZERO);
        };
        if light.direction.dot(surface.geometric_normal) <= 0.0 {
            return (Vec3::ZERO, Vec3::ZERO);
        }
        let passed = world.transmittance(&Ray { origin: start, direction: light.direction }, light.distance_m);
        let arriving = light.radiance * passed / density;
        let gloss = if surface.is_glossy() && surface.roughness >= BLURRED {
            arriving * surface.gloss_cos(light.direction)
        } else {
            Vec3::ZERO
        };
        (arriving * surface.normal.dot(light.direction), gloss)
    }

    /// Light of lamps and portals that gloss reflects, as far as samples of these answer for it, beside what the surface shows
    /// else (`shown`). Curtains are large: rays into the gloss find them.
    fn reflected_light(&self, surface: &Surface, shown: f32, random: [f32; 3], dice: f32) -> Vec3 {
        let (lighting, world) = (&self.baked.cache().lighting, self.baked.world());
        let start = surface.ray(surface.geometric_normal).origin;
        let reflected = Gloss { mirrored: surface.mirrored(), ggx: surface.ggx() };
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
        // Most lamps are not where a surface reflects them from: few rays look whether they are hidden.
        let chance = (luminance(reflected) / (MIN_REFLECTED * shown)).clamp(MIN_CHANCE, 1.0);
        if dice >= chance {
            return Vec3::ZERO;
        }
        let passed = world.transmittance(&Ray { origin: start, direction: light.direction }, light.distance_m);
        reflected * passed / chance
    }

    /// Puts the sun's own light on what a ray within a pixel sees in place of that of the pixel, for sample `number` of the pixel.
    pub(crate) fn renew_sun(&self, seen: &Seen, at: (usize, usize), number: usize, lit: &mut Lit) {
        let Some(surface) = &seen.surface else { return };
        let turn = (turn(at) + 5 * number as u32) % (TILE * TILE) as u32;
        let (diffuse, gloss) = self.sun(surface, turn);
        lit.sun = diffuse;
        lit.sun_gloss = per_albedo(surface, gloss);
    }

    /// Irradiance by the sun and its gloss.
    fn sun(&self, surface: &Surface, turn: u32) -> (Vec3, Vec3) {
        let world = self.baked.world();
        let Some(disc) = &world.sky.sun else { return (Vec3::ZERO, Vec3::ZERO) };
        let direction = disc.direction([(turn as f32 + 0.5) / (TILE * TILE) as f32, van_der_corput(turn)]);
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

    /// Parts of the light where no surfel knows them.
    fn fresh_parts(&self, surface: &Surface) -> Vec<Part> {
        let mut cut: Vec<CutNode> = Vec::new();
        let tree = &self.baked.cache().lighting.tree;
        tree.cut(surface.position, surface.normal, 0.0, crate::light_sampler::MAX_PARTS, &mut cut);
        let total: f32 = cut.iter().map(|part| part.importance).sum();
        let mut running = 0.0;
        cut.iter()
            .map(|part| {
                running += part.importance / total;
                Part { node: part.node, samples: 1.0, cumulative: running }
            })
            .collect()
    }
}
