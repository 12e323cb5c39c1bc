//! Light at one pixel: a few samples of lamps and portals, the sun, a ray into the gloss, the rest from the cache.

use geometry::{Ray, Vec2, Vec3, orthonormal_basis};

use crate::baked::{BakedWorld, Sampled};
use crate::bsdf;
use crate::gbuffer::Seen;
use crate::light_tree::{CutNode, Lobe};
use crate::lighting::{Part, limited};
use crate::lights::luminance;
use crate::pattern::{Rotations, radical_inverse_3, shifted, van_der_corput};
use crate::scene::Surface;

/// Below this roughness the lobe is no wider than a few pixels: a mirror. From it on lamps are sampled for the gloss.
const SHARP: f32 = 0.12;

/// From this roughness on the gloss of plastics, wood and plaster sees the mean light around.
const BLURRED: f32 = 0.5;

/// A sample of a reflected lamp counts no more than this many times the lamp's own radiance times the gloss's albedo.
const MOST_REFLECTED: f32 = 2.0;

/// Reflected lamps below this share of what else a surface shows are looked for by chance,
const LEAST_REFLECTED: f32 = 0.05;

/// which is at least this.
const LEAST_CHANCE: f32 = 0.1;

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
    /// Light reflected by the rough gloss, divided by the gloss's albedo.
    rough_gloss: Vec3,
    /// Light reflected by the gloss, for surfaces whose pixels do not share it.
    sharp_gloss: Vec3,
    /// Variance of [`Lit::brightness`], where it is a mean over pixels.
    pub variance: f32,
}

impl Lit {
    /// Itself without what pixels share.
    pub(crate) fn nothing(&self) -> Self {
        Self { lamps: Vec3::ZERO, rough_gloss: Vec3::ZERO, ..*self }
    }

    pub(crate) fn add(&mut self, other: &Self, weight: f32) {
        self.lamps += other.lamps * weight;
        self.rough_gloss += other.rough_gloss * weight;
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
        luminance(self.lamps) + luminance(self.rough_gloss)
    }

    pub(crate) fn divide(&mut self, by: f32) {
        self.lamps /= by;
        self.rough_gloss /= by;
    }

    /// Mean of what pixels share and own samples.
    pub(crate) fn mix(&mut self, own: &Self, weight: f32, own_weight: f32) {
        let share = own_weight / (weight + own_weight);
        self.lamps = self.lamps.lerp(own.lamps, share);
        self.rough_gloss = self.rough_gloss.lerp(own.rough_gloss, share);
    }

    /// Light that the gloss reflects.
    pub(crate) fn gloss(&self, surface: &Surface) -> Vec3 {
        self.sharp_gloss + self.rough_gloss * gloss_albedo(surface)
    }
}

fn gloss_albedo(surface: &Surface) -> Vec3 {
    bsdf::specular_albedo(surface.f0, surface.roughness, surface.normal.dot(surface.view))
}

/// Samples light at pixels of a baked world.
pub(crate) struct Sampler<'a> {
    baked: &'a BakedWorld,
    rotations: Rotations,
}

impl<'a> Sampler<'a> {
    pub(crate) fn new(baked: &'a BakedWorld) -> Self {
        Self { baked, rotations: Rotations::new("transport view", baked.settings().seed) }
    }

    /// Light at a pixel from `rays` light samples, which are part of a pattern over the tile of pixels around.
    pub(crate) fn sample(&self, seen: &Seen, (x, y): (usize, usize), rays: u32) -> Lit {
        let Some(surface) = &seen.surface else { return Lit::default() };
        let cache = self.baked.cache();
        let turn = ORDER[(y % TILE) * TILE + x % TILE];
        let near = cache.surfels.near(surface.position, surface.geometric_normal, cache.surfels.part(surface.triangle));
        let mut lit = Lit { indirect: near.mean(|surfel| cache.indirect[surfel]), ..Lit::default() };
        if surface.through != Vec3::ZERO {
            lit.behind = near.mean(|surfel| cache.behind[surfel]);
        }
        let mut rough = Vec3::ZERO;
        if surface.diffuse != Vec3::ZERO || surface.is_glossy() {
            let fresh;
            let parts = match near.best() {
                Some(surfel) => cache.parts(surfel),
                None => {
                    fresh = self.fresh_parts(surface);
                    &fresh
                }
            };
            let samples = rays * (TILE * TILE) as u32;
            let jitter = self.rotations.of(x / TILE * 59 + y / TILE * 997);
            for k in 0..rays {
                let (diffuse, gloss) = self.lamp(surface, parts, turn * rays + k, samples, jitter);
                lit.lamps += diffuse / rays as f32;
                rough += gloss / rays as f32;
            }
            if surface.is_glossy() && (SHARP..BLURRED).contains(&surface.roughness) {
                let shown = luminance(surface.diffuse * (lit.lamps + lit.indirect)) / std::f32::consts::PI;
                let rays = rays.div_ceil(2);
                for k in 0..rays {
                    let (index, samples) = (turn * rays + k, rays * (TILE * TILE) as u32);
                    lit.sharp_gloss += self.reflected_lamp(surface, shown, index, samples, jitter) / rays as f32;
                }
            }
            let (diffuse, gloss) = self.sun(surface, turn);
            lit.sun = diffuse;
            lit.sharp_gloss += gloss;
        }
        if surface.is_glossy() {
            self.gloss(surface, turn, rough, &mut lit);
        }
        lit
    }

    fn gloss(&self, surface: &Surface, turn: u32, lamps: Vec3, lit: &mut Lit) {
        let albedo = gloss_albedo(surface);
        let share = |light: Vec3| light / albedo.max(Vec3::splat(1e-6));
        if surface.roughness >= BLURRED && surface.f0.max_element() < 0.2 {
            lit.rough_gloss = share(lamps);
            lit.sharp_gloss += albedo * lit.indirect / std::f32::consts::PI;
            return;
        }
        if surface.roughness < SHARP {
            lit.sharp_gloss += albedo * self.baked.light_along(surface.ray(surface.mirrored()), Sampled::Nothing);
            return;
        }
        let random = Vec2::new(van_der_corput(turn), (turn as f32 + 0.5) / (TILE * TILE) as f32);
        let basis = orthonormal_basis(surface.normal);
        let (direction, weight) =
            bsdf::sample_lobe(surface.f0, surface.alpha(), basis.transpose() * surface.view, random);
        let direction = basis * direction;
        let above = weight != Vec3::ZERO && direction.dot(surface.geometric_normal) > 0.0;
        let sampled = if surface.roughness >= BLURRED { Sampled::All } else { Sampled::Lamps };
        let along = |ray| weight * self.baked.light_along(ray, sampled);
        let ray = if above { along(surface.ray(direction)) } else { Vec3::ZERO };
        lit.rough_gloss = share(lamps + ray);
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
        let scene = self.baked.scene();
        let start = surface.ray(surface.geometric_normal).origin;
        let Some((light, density)) = lighting.sample(scene, start, surface.normal, parts[at].node, random, probability)
        else {
            return (Vec3::ZERO, Vec3::ZERO);
        };
        if light.direction.dot(surface.geometric_normal) <= 0.0 {
            return (Vec3::ZERO, Vec3::ZERO);
        }
        let passed = scene.transmittance(&Ray { origin: start, direction: light.direction }, light.distance_m);
        let arriving = light.radiance * passed / density;
        let gloss = if surface.is_glossy() && surface.roughness >= BLURRED {
            arriving * bsdf::specular_cos(surface.f0, surface.alpha(), surface.normal, surface.view, light.direction)
        } else {
            Vec3::ZERO
        };
        (arriving * surface.normal.dot(light.direction), gloss)
    }

    /// Light of lamps that a narrow lobe reflects, beside what the surface shows else (`shown`). Windows and curtains are large: a ray
    /// into the lobe finds them better.
    fn reflected_lamp(&self, surface: &Surface, shown: f32, index: u32, samples: u32, jitter: [f32; 4]) -> Vec3 {
        let random = [
            shifted((index as f32 + 0.5) / samples as f32, jitter[0]),
            shifted(van_der_corput(index), jitter[1]),
            shifted(radical_inverse_3(index), jitter[2]),
        ];
        let (lighting, scene) = (&self.baked.cache().lighting, self.baked.scene());
        let start = surface.ray(surface.geometric_normal).origin;
        let lobe = Lobe { mirrored: surface.mirrored(), alpha: surface.alpha() };
        let sample = lighting.sample_reflected(scene, start, surface.normal, &lobe, random);
        let Some((light, density)) = sample.filter(|(light, _)| light.lamp) else { return Vec3::ZERO };
        if light.direction.dot(surface.geometric_normal) <= 0.0 {
            return Vec3::ZERO;
        }
        let gloss = bsdf::specular_cos(surface.f0, surface.alpha(), surface.normal, surface.view, light.direction);
        // What is reflected is never brighter than the lamp; a sample beside it would be.
        let most = MOST_REFLECTED * luminance(light.radiance * gloss_albedo(surface));
        let reflected = limited(light.radiance * gloss / density, most);
        if reflected == Vec3::ZERO {
            return Vec3::ZERO;
        }
        // Most lamps are not where a surface reflects them from: few rays look whether they are hidden.
        let chance = (luminance(reflected) / (LEAST_REFLECTED * shown)).clamp(LEAST_CHANCE, 1.0);
        if shifted(index as f32 * 0.618_034 % 1.0, jitter[3]) >= chance {
            return Vec3::ZERO;
        }
        let passed = scene.transmittance(&Ray { origin: start, direction: light.direction }, light.distance_m);
        reflected * passed / chance
    }

    /// Irradiance by the sun and its gloss.
    fn sun(&self, surface: &Surface, turn: u32) -> (Vec3, Vec3) {
        let scene = self.baked.scene();
        let Some(disc) = &scene.sky.sun else { return (Vec3::ZERO, Vec3::ZERO) };
        let direction = disc.direction([(turn as f32 + 0.5) / (TILE * TILE) as f32, van_der_corput(turn)]);
        let cosine = surface.normal.dot(direction);
        let ray = surface.ray(direction);
        let may_come = scene.sky.is_open(&ray, scene.far_m);
        if cosine <= 0.0 || direction.dot(surface.geometric_normal) <= 0.0 || !may_come {
            return (Vec3::ZERO, Vec3::ZERO);
        }
        let radiance = Vec3::from(disc.sun.radiance) * scene.transmittance(&ray, scene.far_m) * disc.solid_angle_sr;
        let gloss = if surface.is_glossy() {
            bsdf::specular_cos(surface.f0, surface.alpha(), surface.normal, surface.view, direction)
        } else {
            Vec3::ZERO
        };
        (radiance * cosine, radiance * gloss)
    }

    /// Parts of the light where no surfel knows them.
    fn fresh_parts(&self, surface: &Surface) -> Vec<Part> {
        let mut cut: Vec<CutNode> = Vec::new();
        let tree = &self.baked.cache().lighting.tree;
        tree.cut(surface.position, surface.normal, 0.0, crate::lighting::MOST_PARTS, &mut cut);
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
