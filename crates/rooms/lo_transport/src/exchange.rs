//! Diffuse interreflection between surfels, iterated to convergence, and the denoising of indirect light.

use std::f32::consts::PI;

use lo_geometry::Vec3;
use rayon::prelude::*;

use crate::gather::GatherResult;
use crate::light_sampler::limited;
use crate::lights::luminance;
use crate::neighbourhoods::Neighbourhoods;
use crate::surfels::{Surfel, Surfels};

/// Passes that remove single bright and dark surfels. More passes would close larger holes.
const OUTLIER_PASSES: usize = 3;

/// Filter radius of indirect light, as a share of the harmonic mean distance to the surroundings.
const RADIUS_SHARE: f32 = 0.25;

/// Minimum and maximum number of filter passes.
const FILTER_PASSES: std::ops::RangeInclusive<f32> = 2.0..=40.0;

/// Standard deviation of one filter pass along an axis, in spacings.
const SPREAD_OF_PASS: f32 = 0.5;

/// Filter passes over the light of mirrored lamps.
const MIRRORED_PASSES: usize = 6;

/// Propagates light along the links until it converges. Returns the irradiance without direct light. `others` are the
/// surfels on the other side of sheets.
pub(crate) fn exchange(
    surfels: &Surfels,
    gathered: &[GatherResult],
    direct: &[Vec3],
    others: &[u32],
    gather_rays: u32,
) -> Vec<Vec3> {
    const MAX_BOUNCES: usize = 400;
    let mut indirect: Vec<Vec3> = gathered.iter().map(|result| result.light).collect();
    let mut leaving = vec![Vec3::ZERO; gathered.len()];
    for _ in 0..MAX_BOUNCES {
        leaving.par_iter_mut().enumerate().for_each(|(i, light)| {
            *light = self::leaving(surfels, |i| direct[i] + indirect[i], others, i);
        });
        let arriving = |result: &GatherResult| {
            let seen: Vec3 = result.links.iter().map(|&surfel| leaving[surfel as usize]).sum();
            let mirrored: Vec3 = result.tinted.iter().map(|&(surfel, tint)| leaving[surfel as usize] * tint).sum();
            result.light + (seen + mirrored) * (PI / gather_rays as f32)
        };
        let next: Vec<Vec3> = gathered.par_iter().map(arriving).collect();
        let sum = |values: &[Vec3]| values.iter().map(|v| f64::from(v.element_sum())).sum::<f64>();
        let (before, after) = (sum(&indirect), sum(&next));
        indirect = next;
        if (after - before).abs() <= 2e-4 * after.abs() {
            break;
        }
    }
    indirect
}

/// Returns the radiance leaving surfel `i`, given the irradiance of all surfels.
pub(crate) fn leaving(surfels: &Surfels, irradiance: impl Fn(usize) -> Vec3, others: &[u32], i: usize) -> Vec3 {
    let scattering = &surfels.list[i].scattering;
    let own = irradiance(i) * scattering.same_side;
    let behind = if others[i] == u32::MAX { Vec3::ZERO } else { irradiance(others[i] as usize) };
    (own + behind * scattering.through) / PI
}

/// Adds the light of mirrored lamps, which few rays find, smoothed over neighbours.
pub(crate) fn spread_mirrored(surfels: &Surfels, neighbourhoods: &Neighbourhoods, gathered: &mut [GatherResult]) {
    if gathered.iter().all(|result| result.mirrored == Vec3::ZERO && result.excess == Vec3::ZERO) {
        return;
    }
    let mut mirrored: Vec<Vec3> = gathered.iter().map(|result| result.mirrored).collect();
    for _ in 0..MIRRORED_PASSES {
        mirrored = (0..gathered.len()).into_par_iter().map(|i| neighbourhoods.mean(i, &mirrored)).collect();
    }
    // Excess found by few rays is distributed over all surfaces with the same facing.
    let mut sums = [(Vec3::ZERO, 0.0_f32); 6];
    for (surfel, result) in surfels.list.iter().zip(&*gathered) {
        let sum = &mut sums[surfel.face()];
        *sum = (sum.0 + result.excess * surfel.area_m2(), sum.1 + surfel.area_m2());
    }
    for ((surfel, result), mirrored) in surfels.list.iter().zip(gathered).zip(mirrored) {
        let (sum, area_m2) = sums[surfel.face()];
        result.light += mirrored + sum / area_m2;
    }
}

/// Denoises indirect light: first removes outliers, then averages over neighbours. The filter is wider where everything
/// is far away, since distant light changes slowly (Ward et al. 1988).
pub(crate) fn denoise(
    surfels: &Surfels,
    neighbourhoods: &Neighbourhoods,
    gathered: &[GatherResult],
    indirect: &mut Vec<Vec3>,
) {
    for _ in 0..OUTLIER_PASSES {
        *indirect = (0..gathered.len()).into_par_iter().map(|i| clamped(neighbourhoods, indirect, i)).collect();
    }
    let passes = |(surfel, result): (&Surfel, &GatherResult)| {
        let reach = RADIUS_SHARE / (SPREAD_OF_PASS * surfel.spacing_m * result.nearness_per_m.max(1e-6));
        (reach * reach).clamp(*FILTER_PASSES.start(), *FILTER_PASSES.end()) as u32
    };
    let passes: Vec<u32> = surfels.list.iter().zip(gathered).map(passes).collect();
    for pass in 0..*FILTER_PASSES.end() as u32 {
        let averaged = |i: usize| if pass < passes[i] { neighbourhoods.mean(i, indirect) } else { indirect[i] };
        *indirect = (0..gathered.len()).into_par_iter().map(averaged).collect();
    }
    // Corrections for sampled emitters can leave slightly negative values.
    indirect.iter_mut().for_each(|light| *light = light.max(Vec3::ZERO));
}

/// Clamps a surfel that is far brighter or darker than all its neighbours: a single lucky ray, or an excessive
/// correction.
fn clamped(neighbourhoods: &Neighbourhoods, indirect: &[Vec3], i: usize) -> Vec3 {
    /// Maximum ratio of indirect light between neighbouring surfels.
    const MAX_RATIO: f32 = 3.0;
    let others = neighbourhoods.of(i).iter().filter(|(other, _)| *other as usize != i);
    let (sum, count) = others
        .fold((Vec3::ZERO, 0), |(sum, count), &(other, _)| (sum + indirect[other as usize].max(Vec3::ZERO), count + 1));
    if count < 2 {
        return indirect[i];
    }
    let around = sum / count as f32;
    if MAX_RATIO * luminance(indirect[i]) < luminance(around) {
        around / MAX_RATIO
    } else {
        limited(indirect[i], MAX_RATIO * luminance(around))
    }
}
