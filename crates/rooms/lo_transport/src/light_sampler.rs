//! Sampling of direct light from emitters and the sun.

use std::f32::consts::PI;

use lo_geometry::Vec3;
use lo_mesh::offset_origin;

use crate::light_tree::{CutNode, GlossyLobe, LightTree};
use crate::lights::{EmitterShape, Emitters, LightSample, luminance};
use crate::pattern::{self, shifted};
use crate::surfels::Surfels;
use crate::traced_world::TracedWorld;

/// Maximum number of clusters of a cut.
pub(crate) const MAX_CLUSTERS: usize = 16;

/// Emitters with their hierarchy.
pub(crate) struct LightSampler<'a> {
    pub emitters: Emitters,
    pub tree: LightTree,
    /// For secondary emitters: the radiance leaving each surfel. The emitters hold means of it.
    pub surfel_radiance: Option<SurfelRadiance<'a>>,
}

/// Radiance leaving surfels.
pub(crate) struct SurfelRadiance<'a> {
    pub surfels: &'a Surfels,
    pub leaving: Vec<Vec3>,
}

impl SurfelRadiance<'_> {
    /// Returns the radiance leaving a point.
    pub(crate) fn radiance(&self, position: Vec3, normal: Vec3, triangle: u32) -> Vec3 {
        let surfel = self.surfels.nearest(position, normal, self.surfels.component(triangle));
        surfel.map_or(Vec3::ZERO, |surfel| self.leaving[surfel as usize])
    }
}

/// Cluster of emitters, with the number of samples spent on it and the probabilities for nearby points.
#[derive(Clone, Copy, Debug)]
pub(crate) struct LightCluster {
    pub node: u32,
    pub samples: f32,
    /// Cumulative probability of all clusters up to and including this one.
    pub cumulative: f32,
}

/// Direct light on one side of a point.
pub(crate) struct DirectLight {
    /// Irradiance by lamps and portals.
    pub irradiance: Vec3,
    pub sun: Vec3,
    pub clusters: Vec<LightCluster>,
}

impl LightSampler<'_> {
    pub(crate) fn new(emitters: Emitters) -> Self {
        Self { tree: LightTree::build(&emitters.list), emitters, surfel_radiance: None }
    }

    /// Returns the irradiance at a point and the light clusters, which are valid within `reach_m`. `gather_rays` is the
    /// number of cosine-distributed rays that also find lamps. Both strategies are combined by the balance heuristic.
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
    ) -> DirectLight {
        let origin = offset_origin(position, normal);
        let mut cut: Vec<CutNode> = Vec::with_capacity(MAX_CLUSTERS + 1);
        self.tree.cut(origin, normal, reach_m, MAX_CLUSTERS, &mut cut);
        let total: f32 = cut.iter().map(|cluster| cluster.importance).sum();
        let mut irradiance = Vec3::ZERO;
        let mut clusters = Vec::with_capacity(cut.len());
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
            // Laplace's rule of succession: light that no sample reached may still be visible to a pixel nearby.
            running += importance * (seen + 1.0) / (samples + 2.0);
            clusters.push(LightCluster { node, samples, cumulative: running });
        }
        for cluster in &mut clusters {
            cluster.cumulative /= running;
        }
        DirectLight { irradiance, sun: self.sun(world, origin, normal, rotation), clusters }
    }

    /// Samples a node. Returns the sample and the density per steradian of all `samples` together.
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

    /// Samples all lights for a glossy reflection.
    pub(crate) fn sample_reflected(
        &self,
        world: &TracedWorld,
        origin: Vec3,
        normal: Vec3,
        gloss: &GlossyLobe,
        random: [f32; 3],
    ) -> Option<(LightSample, f32)> {
        let u = random[0].min(1.0 - f32::EPSILON);
        let (chosen, probability) = self.tree.choose_reflected(u, origin, normal, gloss)?;
        self.sample_of(world, origin, normal, chosen, [random[1], random[2]], probability)
    }

    /// Returns the density per steradian with which [`LightSampler::sample_reflected`] samples a point of an emitter.
    pub(crate) fn density_reflected(
        &self,
        emitter: u32,
        origin: Vec3,
        normal: Vec3,
        gloss: &GlossyLobe,
        sr_per_m2: f32,
    ) -> f32 {
        let probability = self.tree.probability_reflected(emitter, origin, normal, gloss).unwrap_or(0.0);
        probability / (self.emitters.list[emitter as usize].area_m2 * sr_per_m2)
    }

    /// Samples an emitter that is chosen `times` times on average.
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
        if let (Some(surfel_radiance), EmitterShape::Triangle { triangle, .. }) = (&self.surfel_radiance, emitter.shape)
        {
            let side = if light.direction.dot(emitter.normal) < 0.0 { emitter.normal } else { -emitter.normal };
            light.radiance = surfel_radiance.radiance(origin + light.direction * light.distance_m, side, triangle);
        }
        let density = times / (emitter.area_m2 * light.sr_per_m2);
        (normal.dot(light.direction) > 0.0 && light.radiance != Vec3::ZERO).then_some((light, density))
    }

    /// Returns the density per steradian with which [`LightSampler::direct`] samples a point of an emitter, all samples
    /// together.
    pub(crate) fn density(
        &self,
        clusters: &[LightCluster],
        emitter: u32,
        origin: Vec3,
        normal: Vec3,
        sr_per_m2: f32,
    ) -> f32 {
        self.tree.find(clusters.iter().map(|cluster| cluster.node), emitter, origin, normal).map_or(
            0.0,
            |(at, probability)| {
                let area = self.emitters.list[emitter as usize].area_m2;
                clusters[at].samples * probability / (area * sr_per_m2)
            },
        )
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

/// Clamps light to the luminance `max`.
pub(crate) fn limited(light: Vec3, max: f32) -> Vec3 {
    let brightness = luminance(light);
    if brightness > max { light * (max / brightness) } else { light }
}
