//! Light at the surfels: lamps, portals and the sun sampled directly, all else exchanged between surfels.

use std::f32::consts::PI;

use lo_geometry::{Vec3, cosine_hemisphere};
use rayon::prelude::*;

use crate::BakeSettings;
use crate::bright::{bright, push_sheets};
use crate::exchange::{denoise, exchange, leaving, spread_mirrored};
use crate::gather::Gatherer;
use crate::light_sampler::{Direct, LightSampler, Part};
use crate::lights::Emitters;
use crate::neighbourhoods::Neighbourhoods;
use crate::pattern::Rotations;
use crate::reach;
use crate::surfels::{Surfel, Surfels};
use crate::traced_world::TracedWorld;

/// Light at the surfels and what it was sampled from.
pub(crate) struct Cache {
    pub surfels: Surfels,
    pub lighting: LightSampler<'static>,
    /// Irradiance by lamps, portals, sun and glowing sheets.
    pub direct: Vec<Vec3>,
    /// Irradiance by everything else.
    pub indirect: Vec<Vec3>,
    /// Irradiance on the other side of the sheet; zero where nothing shines through.
    pub behind: Vec<Vec3>,
    /// Mean cube of the distance to what each surfel sees; a measure of the space from which it is seen. 0 under the open sky.
    pub open_m3: Vec<f32>,
    parts: Vec<Part>,
    first_part: Vec<u32>,
}

impl Cache {
    pub(crate) fn bake(world: &TracedWorld, settings: &BakeSettings) -> Result<Self, crate::TransportError> {
        let emitters = Emitters::new(world);
        let mut surfels = Surfels::spread(world, &emitters, settings.spacing_m)?;
        let mut lighting = LightSampler::new(emitters);
        surfels.retain(&reach::reached(world, &surfels, &lighting.emitters, &other_sides(&surfels)));
        let others = other_sides(&surfels);
        let rotations = Rotations::new("transport cache", settings.seed);
        let sample = |lighting: &LightSampler, surfel: &Surfel, rays: u32, gather_rays: u32, i: usize| {
            let (position, reach_m) = (surfel.position, surfel.spacing_m);
            lighting.direct(world, position, surfel.normal, reach_m, rays, gather_rays, rotations.of(i))
        };
        // Sheets lit from behind become lights themselves.
        if others.iter().any(|&other| other != u32::MAX) {
            let glow = |(i, &other): (usize, &u32)| {
                if other == u32::MAX {
                    return Vec3::ZERO;
                }
                let light = sample(&lighting, &surfels.list[other as usize], 4 * settings.light_rays, 0, i);
                surfels.list[i].scatter.through * (light.irradiance + light.sun) / PI
            };
            let glow: Vec<Vec3> = others.par_iter().enumerate().map(glow).collect();
            let mut emitters = lighting.emitters;
            push_sheets(world, &surfels, &glow, &mut emitters);
            lighting = LightSampler::new(emitters);
        }
        let light = |(i, surfel)| sample(&lighting, surfel, settings.light_rays, settings.gather_rays, i);
        let lit: Vec<Direct> = surfels.list.par_iter().enumerate().map(light).collect();
        let estimate = first_estimate(&surfels, &lit, &others);
        let bright = bright(world, &surfels, &lighting, estimate);
        let pattern = cosine_hemisphere(settings.gather_rays as usize);
        let gatherer = Gatherer { world, settings, rotations: &rotations, pattern };
        let mut rows = gatherer.gather(&surfels, &lighting, &bright, &lit);
        drop(bright);
        let neighbourhoods = Neighbourhoods::new(&surfels);
        spread_mirrored(&surfels, &neighbourhoods, &mut rows);
        let direct: Vec<Vec3> = lit.iter().zip(&rows).map(|(lit, row)| lit.irradiance + row.lamps + lit.sun).collect();
        let mut indirect = exchange(&surfels, &rows, &direct, &others, settings.gather_rays);
        denoise(&surfels, &neighbourhoods, &rows, &mut indirect);
        let behind = |&other: &u32| match other {
            u32::MAX => Vec3::ZERO,
            other => direct[other as usize] + indirect[other as usize],
        };
        let behind = others.iter().map(behind).collect();
        let mut open_m3: Vec<f32> = rows.iter().map(|row| row.open_m3).collect();
        if !world.sky.portals.is_empty() {
            // What lies under the open sky must not show indoors, behind a thin wall.
            let outside: Vec<bool> = rows.iter().map(|row| row.escaped > settings.gather_rays / 5).collect();
            surfels.set_outside(&outside);
            open_m3.iter_mut().zip(outside).filter(|(_, outside)| *outside).for_each(|(open, _)| *open = 0.0);
        }
        let (mut parts, mut first_part) = (Vec::new(), vec![0]);
        for lit in lit {
            parts.extend(lit.parts);
            first_part.push(parts.len() as u32);
        }
        Ok(Self { surfels, lighting, direct, indirect, behind, open_m3, parts, first_part })
    }

    /// Parts of the light at a surfel.
    pub(crate) fn parts(&self, surfel: u32) -> &[Part] {
        let at = surfel as usize;
        &self.parts[self.first_part[at] as usize..self.first_part[at + 1] as usize]
    }
}

/// For surfels of sheets that let diffuse light through, the surfel on the other side.
fn other_sides(surfels: &Surfels) -> Vec<u32> {
    let other = |surfel: &Surfel| {
        if surfel.scatter.through == Vec3::ZERO {
            return u32::MAX;
        }
        surfels.near(surfel.position, -surfel.normal, surfel.part).best().unwrap_or(u32::MAX)
    };
    surfels.list.par_iter().map(other).collect()
}

/// Radiance leaving each surfel if indirect light were the same everywhere.
fn first_estimate(surfels: &Surfels, lit: &[Direct], others: &[u32]) -> Vec<Vec3> {
    let direct = |i: usize| lit[i].irradiance + lit[i].sun;
    let mean = surfels.mean(direct);
    let albedo = surfels.mean(|i| surfels.list[i].scatter.same_side);
    let ambient = mean * albedo / (Vec3::ONE - albedo).max(Vec3::splat(0.1));
    (0..lit.len()).map(|i| leaving(surfels, |i| direct(i) + ambient, others, i)).collect()
}
