//! Baking of light at the surfels: lamps, portals and the sun are sampled directly, all else is exchanged between
//! surfels.

use std::f32::consts::PI;

use lo_geometry::{Vec3, cosine_hemisphere};
use rayon::prelude::*;

use crate::BakeSettings;
use crate::exchange::{denoise, exchange, leaving, spread_mirrored};
use crate::gather::Gatherer;
use crate::light_sampler::{DirectLight, LightCluster, LightSampler};
use crate::lights::Emitters;
use crate::neighbourhoods::Neighbourhoods;
use crate::pattern::Rotations;
use crate::reachability;
use crate::secondary_emitters::{push_sheets, secondary_emitters};
use crate::surfels::{Surfel, Surfels};
use crate::traced_world::TracedWorld;

/// Light at the surfels and the emitters it was sampled from.
pub(crate) struct SurfaceCache {
    pub surfels: Surfels,
    pub lighting: LightSampler<'static>,
    /// Irradiance by lamps, portals, sun and glowing sheets.
    pub direct: Vec<Vec3>,
    /// Irradiance by everything else.
    pub indirect: Vec<Vec3>,
    /// Irradiance on the other side of the sheet. 0 for opaque surfaces.
    pub behind: Vec<Vec3>,
    /// Mean cubed distance to the surroundings of each surfel: a measure of the space from which it is visible. 0 under
    /// the open sky.
    pub open_m3: Vec<f32>,
    clusters: Vec<LightCluster>,
    first_cluster: Vec<u32>,
}

impl SurfaceCache {
    pub(crate) fn bake(world: &TracedWorld, settings: &BakeSettings) -> Result<Self, crate::TransportError> {
        let emitters = Emitters::new(world);
        let mut surfels = Surfels::spread(world, &emitters, settings.spacing_m)?;
        let mut lighting = LightSampler::new(emitters);
        surfels.retain(&reachability::reachable(world, &surfels, &lighting.emitters, &other_sides(&surfels)));
        let others = other_sides(&surfels);
        let rotations = Rotations::new("transport cache", settings.seed);
        let sample = |lighting: &LightSampler, surfel: &Surfel, rays: u32, gather_rays: u32, i: usize| {
            let (position, reach_m) = (surfel.position, surfel.spacing_m);
            lighting.direct(world, position, surfel.normal, reach_m, rays, gather_rays, rotations.of(i))
        };
        // Sheets lit from behind become emitters.
        if others.iter().any(|&other| other != u32::MAX) {
            let glow = |(i, &other): (usize, &u32)| {
                if other == u32::MAX {
                    return Vec3::ZERO;
                }
                let light = sample(&lighting, &surfels.list[other as usize], 4 * settings.light_rays, 0, i);
                surfels.list[i].scattering.through * (light.irradiance + light.sun) / PI
            };
            let glow: Vec<Vec3> = others.par_iter().enumerate().map(glow).collect();
            let mut emitters = lighting.emitters;
            push_sheets(world, &surfels, &glow, &mut emitters);
            lighting = LightSampler::new(emitters);
        }
        let light = |(i, surfel)| sample(&lighting, surfel, settings.light_rays, settings.gather_rays, i);
        let lit: Vec<DirectLight> = surfels.list.par_iter().enumerate().map(light).collect();
        let estimate = first_estimate(&surfels, &lit, &others);
        let secondary = secondary_emitters(world, &surfels, &lighting, estimate);
        let pattern = cosine_hemisphere(settings.gather_rays as usize);
        let gatherer = Gatherer { world, settings, rotations: &rotations, pattern };
        let mut gathered = gatherer.gather(&surfels, &lighting, &secondary, &lit);
        drop(secondary);
        let neighbourhoods = Neighbourhoods::new(&surfels);
        spread_mirrored(&surfels, &neighbourhoods, &mut gathered);
        let direct: Vec<Vec3> =
            lit.iter().zip(&gathered).map(|(lit, result)| lit.irradiance + result.lamps + lit.sun).collect();
        let mut indirect = exchange(&surfels, &gathered, &direct, &others, settings.gather_rays);
        denoise(&surfels, &neighbourhoods, &gathered, &mut indirect);
        let behind = |&other: &u32| match other {
            u32::MAX => Vec3::ZERO,
            other => direct[other as usize] + indirect[other as usize],
        };
        let behind = others.iter().map(behind).collect();
        let mut open_m3: Vec<f32> = gathered.iter().map(|result| result.open_m3).collect();
        if !world.sky.portals.is_empty() {
            // Surfels under the open sky must not be interpolated indoors, behind a thin wall.
            let outside: Vec<bool> = gathered.iter().map(|result| result.escaped > settings.gather_rays / 5).collect();
            surfels.set_outside(&outside);
            open_m3.iter_mut().zip(outside).filter(|(_, outside)| *outside).for_each(|(open, _)| *open = 0.0);
        }
        let (mut clusters, mut first_cluster) = (Vec::new(), vec![0]);
        for lit in lit {
            clusters.extend(lit.clusters);
            first_cluster.push(clusters.len() as u32);
        }
        Ok(Self { surfels, lighting, direct, indirect, behind, open_m3, clusters, first_cluster })
    }

    /// Returns the light clusters of a surfel.
    pub(crate) fn clusters(&self, surfel: u32) -> &[LightCluster] {
        let at = surfel as usize;
        &self.clusters[self.first_cluster[at] as usize..self.first_cluster[at + 1] as usize]
    }
}

/// For each surfel of a translucent sheet, returns the surfel on the other side. `u32::MAX` elsewhere.
fn other_sides(surfels: &Surfels) -> Vec<u32> {
    let other = |surfel: &Surfel| {
        if surfel.scattering.through == Vec3::ZERO {
            return u32::MAX;
        }
        surfels.near(surfel.position, -surfel.normal, surfel.component).best().unwrap_or(u32::MAX)
    };
    surfels.list.par_iter().map(other).collect()
}

/// Estimates the radiance leaving each surfel under uniform indirect light.
fn first_estimate(surfels: &Surfels, lit: &[DirectLight], others: &[u32]) -> Vec<Vec3> {
    let direct = |i: usize| lit[i].irradiance + lit[i].sun;
    let mean = surfels.mean(direct);
    let albedo = surfels.mean(|i| surfels.list[i].scattering.same_side);
    let ambient = mean * albedo / (Vec3::ONE - albedo).max(Vec3::splat(0.1));
    (0..lit.len()).map(|i| leaving(surfels, |i| direct(i) + ambient, others, i)).collect()
}
