//! Direct light: emitters, their hierarchy and the sun, sampled at a point.

use std::f32::consts::PI;

use lo_geometry::Vec3;
use lo_mesh::offset_origin;

use crate::light_tree::{CutNode, Gloss, LightTree};
use crate::lights::{Emitters, LightSample, Source, luminance};
use crate::pattern::{self, shifted};
use crate::surfels::Surfels;
use crate::traced_world::TracedWorld;

/// Most parts of a cut.
pub(crate) const MAX_PARTS: usize = 16;

/// What light is sampled from.
pub(crate) struct LightSampler<'a> {
    pub emitters: Emitters,
    pub tree: LightTree,
    /// Where the emitters are surfaces lit by others: the radiance leaving each surfel, of which emitters hold means.
    pub surfaces: Option<Surfaces<'a>>,
}

/// Radiance leaving surfels.
pub(crate) struct Surfaces<'a> {
    pub surfels: &'a Surfels,
    pub leaving: Vec<Vec3>,
}

impl Surfaces<'_> {
    /// Radiance at a place.
    pub(crate) fn radiance(&self, position: Vec3, normal: Vec3, triangle: u32) -> Vec3 {
        let surfel = self.surfels.nearest(position, normal, self.surfels.part(triangle));
        surfel.map_or(Vec3::ZERO, |surfel| self.leaving[surfel as usize])
    }
}

/// A part of the light, the samples spent on it, and how it is chosen for points nearby.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Part {
    pub node: u32,
    pub samples: f32,
    /// Running sum of the probabilities of all parts up to and with this one.
    pub cumulative: f32,
}

/// Direct light at one side of a point.
pub(crate) struct Direct {
    /// Lamps and portals.
    pub irradiance: Vec3,
    pub sun: Vec3,
    pub parts: Vec<Part>,
}

impl LightSampler<'_> {
    pub(crate) fn new(emitters: Emitters) -> Self {
        Self { tree: LightTree::build(&emitters.list), emitters, surfaces: None }
    }

    /// Irradiance at a point, its light cut into parts that are valid within `reach_m`. `gather_rays` is the number of
    /// cosine-distributed rays that find lamps too: both are weighed by the balance heuristic.
    #[expect(clippy::too_many_arguments, reason = "the state of one point")]
    pub(crate) fn direct(
        &self,
        world: &TracedWorld,
        position: Vec3,
        normal: Vec3,
        reach_m: f32,
        rays: u32,
        gather_rays: u32,
        rotation: [f32; 4],
    ) -> Direct {
        let origin = offset_origin(position, normal);
        let mut cut: Vec<CutNode> = Vec::with_capacity(MAX_PARTS + 1);
        self.tree.cut(origin, normal, reach_m, MAX_PARTS, &mut cut);
        let total: f32 = cut.iter().map(|part| part.importance).sum();
        let mut irradiance = Vec3::ZERO;
        let mut parts = Vec::with_capacity(cut.len());
        let (mut index, mut running) = (0, 0.0);
        for CutNode { node, importance } in cut {
            let samples = (rays as f32 * importance / total).round().max(1.0);
            let mut seen = 0.0;
            for sample in 0..samples as u32 {
                let random = [
                    (sample as f32 + rotation[0]) / samples,
                    shifted(lo_geometry::van_der_corput(index), rotation[1]),
                    shifted(pattern::radical_inverse_3(index), rotation[2]),
                ];
                index += 1;
                let Some((light, density)) = self.sample(world, origin, normal, node, random, samples) else {
                    continue;
                };
                let cosine = normal.dot(light.direction);
                let ray = lo_geometry::Ray { origin, direction: light.direction };
                let passed = world.transmittance(&ray, light.distance_m);
                if passed == Vec3::ZERO {
                    continue;
                }
                seen += 1.0;
                let portal = light.distance_m >= world.far_m;
                let by_gather = if portal { 0.0 } else { gather_rays as f32 * cosine / PI };
                irradiance += light.radiance * passed * (cosine / (density + by_gather));
            }
            // Laplace's rule of succession: what no sample saw may yet be seen by a pixel nearby.
            running += importance * (seen + 1.0) / (samples + 2.0);
            parts.push(Part { node, samples, cumulative: running });
        }
        for part in &mut parts {
            part.cumulative /= running;
        }
        Direct { irradiance, sun: self.sun(world, origin, normal, rotation), parts }
    }

    /// A sample of a part of the light and its density per steradian, that of all `samples` together.
    pub(crate) fn sample(
        &self,
        world: &TracedWorld,
        origin: Vec3,
        normal: Vec3,
        node: u32,
        random: [f32; 3],
        samples: f32,
    ) -> Option<(LightSample, f32)> {
        let (chosen, probability) = self.tree.choose(node, random[0].min(1.0 - f32::EPSILON), origin, normal)?;
        self.sample_of(world, origin, normal, chosen, [random[1], random[2]], samples * probability)
    }

    /// A sample for what gloss reflects, from all lights.
    pub(crate) fn sample_reflected(
        &self,
        world: &TracedWorld,
        origin: Vec3,
        normal: Vec3,
        gloss: &Gloss,
        random: [f32; 3],
    ) -> Option<(LightSample, f32)> {
        let u = random[0].min(1.0 - f32::EPSILON);
        let (chosen, probability) = self.tree.choose_reflected(u, origin, normal, gloss)?;
        self.sample_of(world, origin, normal, chosen, [random[1], random[2]], probability)
    }

    /// Density per steradian with which [`LightSampler::sample_reflected`] samples a point of an emitter.
    pub(crate) fn density_reflected(
        &self,
        emitter: u32,
        origin: Vec3,
        normal: Vec3,
        gloss: &Gloss,
        sr_per_m2: f32,
    ) -> f32 {
        let probability = self.tree.probability_reflected(emitter, origin, normal, gloss).unwrap_or(0.0);
        probability / (self.emitters.list[emitter as usize].area_m2 * sr_per_m2)
    }

    /// A sample of an emitter that is chosen so often on the average.
    fn sample_of(
        &self,
        world: &TracedWorld,
        origin: Vec3,
        normal: Vec3,
        chosen: u32,
        random: [f32; 2],
        times: f32,
    ) -> Option<(LightSample, f32)> {
        let emitter = &self.emitters.list[chosen as usize];
        let mut light = emitter.sample(world, origin, random)?;
        if let (Some(surfaces), Source::Triangle { triangle, .. }) = (&self.surfaces, emitter.source) {
            let side = if light.direction.dot(emitter.normal) < 0.0 { emitter.normal } else { -emitter.normal };
            light.radiance = surfaces.radiance(origin + light.direction * light.distance_m, side, triangle);
        }
        let density = times / (emitter.area_m2 * light.sr_per_m2);
        (normal.dot(light.direction) > 0.0 && light.radiance != Vec3::ZERO).then_some((light, density))
    }

    /// Density per steradian with which [`LightSampler::direct`] sampled a point of an emitter, all samples together.
    pub(crate) fn density(&self, parts: &[Part], emitter: u32, origin: Vec3, normal: Vec3, sr_per_m2: f32) -> f32 {
        self.tree.find(parts.iter().map(|part| part.node), emitter, origin, normal).map_or(0.0, |(at, probability)| {
            let area = self.emitters.list[emitter as usize].area_m2;
            parts[at].samples * probability / (area * sr_per_m2)
        })
    }

    fn sun(&self, world: &TracedWorld, origin: Vec3, normal: Vec3, rotation: [f32; 4]) -> Vec3 {
        const RAYS: u32 = 4;
        let Some(disc) = &world.sky.sun else { return Vec3::ZERO };
        let middle = lo_geometry::Ray { origin, direction: disc.sun.direction };
        if normal.dot(middle.direction) < -disc.sun.angular_radius_rad {
            return Vec3::ZERO;
        }
        let mut sum = Vec3::ZERO;
        for i in 0..RAYS {
            let random = [(i as f32 + rotation[0]) / RAYS as f32, shifted(lo_geometry::van_der_corput(i), rotation[1])];
            let direction = disc.direction(random);
            let cosine = normal.dot(direction);
            let ray = lo_geometry::Ray { origin, direction };
            if cosine > 0.0 && world.sky.is_open(&ray, world.far_m) {
                sum += world.transmittance(&ray, world.far_m) * cosine;
            }
        }
        sum * Vec3::from(disc.sun.radiance) * (disc.solid_angle_sr / RAYS as f32)
    }
}

/// Nothing brighter than this many times the mean comes by way of mirrors into the cache.
pub(crate) fn limited(light: Vec3, most: f32) -> Vec3 {
    let brightness = luminance(light);
    if brightness > most { light * (most / brightness) } else { light }
}
