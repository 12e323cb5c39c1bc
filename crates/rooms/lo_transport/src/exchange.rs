//! Diffuse light passed on from surfel to surfel until nothing changes, and the noise of few rays taken out of it.

use std::f32::consts::PI;

use lo_geometry::Vec3;
use rayon::prelude::*;

use crate::gather::Row;
use crate::light_sampler::limited;
use crate::lights::luminance;
use crate::neighbourhoods::Neighbourhoods;
use crate::surfels::{Surfel, Surfels};

/// Passes that take out single bright and dark surfels; more of them close larger holes.
const DESPECKLING: usize = 3;

/// Indirect light is averaged over this share of the (harmonic mean) distance to what is around.
const REACH_SHARE: f32 = 0.25;

/// Passes of averaging at least and at most.
const PASSES: std::ops::RangeInclusive<f32> = 2.0..=40.0;

/// How far one pass of averaging spreads light along an axis, in spacings (standard deviation).
const SPREAD_OF_PASS: f32 = 0.5;

/// Passes that spread what lamps in mirrors throw.
const MIRRORED_PASSES: usize = 6;

/// Passes light along the links until nothing changes; irradiance without direct light. `others` are the surfels on the other
/// side of sheets.
pub(crate) fn exchange(
    surfels: &Surfels,
    rows: &[Row],
    direct: &[Vec3],
    others: &[u32],
    gather_rays: u32,
) -> Vec<Vec3> {
    const MAX_BOUNCES: usize = 400;
    let mut indirect: Vec<Vec3> = rows.iter().map(|row| row.light).collect();
    let mut leaving = vec![Vec3::ZERO; rows.len()];
    for _ in 0..MAX_BOUNCES {
        leaving.par_iter_mut().enumerate().for_each(|(i, light)| {
            *light = self::leaving(surfels, |i| direct[i] + indirect[i], others, i);
        });
        let arriving = |row: &Row| {
            let seen: Vec3 = row.links.iter().map(|&surfel| leaving[surfel as usize]).sum();
            let mirrored: Vec3 = row.tinted.iter().map(|&(surfel, tint)| leaving[surfel as usize] * tint).sum();
            row.light + (seen + mirrored) * (PI / gather_rays as f32)
        };
        let next: Vec<Vec3> = rows.par_iter().map(arriving).collect();
        let sum = |values: &[Vec3]| values.iter().map(|v| f64::from(v.element_sum())).sum::<f64>();
        let (before, after) = (sum(&indirect), sum(&next));
        indirect = next;
        if (after - before).abs() <= 2e-4 * after.abs() {
            break;
        }
    }
    indirect
}

/// Radiance leaving surfel `i`, given the irradiance of all.
pub(crate) fn leaving(surfels: &Surfels, irradiance: impl Fn(usize) -> Vec3, others: &[u32], i: usize) -> Vec3 {
    let scatter = &surfels.list[i].scatter;
    let own = irradiance(i) * scatter.same_side;
    let behind = if others[i] == u32::MAX { Vec3::ZERO } else { irradiance(others[i] as usize) };
    (own + behind * scatter.through) / PI
}

/// Adds to the rows' light that of mirrored lamps, which few rays find, spread over neighbours.
pub(crate) fn spread_mirrored(surfels: &Surfels, neighbourhoods: &Neighbourhoods, rows: &mut [Row]) {
    if rows.iter().all(|row| row.mirrored == Vec3::ZERO && row.excess == Vec3::ZERO) {
        return;
    }
    let mut mirrored: Vec<Vec3> = rows.iter().map(|row| row.mirrored).collect();
    for _ in 0..MIRRORED_PASSES {
        mirrored = (0..rows.len()).into_par_iter().map(|i| neighbourhoods.mean(i, &mirrored)).collect();
    }
    // What few rays found is spread over all surfaces that face the same way.
    let mut sums = [(Vec3::ZERO, 0.0_f32); 6];
    for (surfel, row) in surfels.list.iter().zip(&*rows) {
        let sum = &mut sums[surfel.face()];
        *sum = (sum.0 + row.excess * surfel.area_m2(), sum.1 + surfel.area_m2());
    }
    for ((surfel, row), mirrored) in surfels.list.iter().zip(rows).zip(mirrored) {
        let (sum, area_m2) = sums[surfel.face()];
        row.light += mirrored + sum / area_m2;
    }
}

/// Takes the noise of few rays out of indirect light: first single surfels, then what is left by averaging over neighbours, widely
/// where everything is far away, for light from afar changes slowly (Ward et al. 1988).
pub(crate) fn denoise(surfels: &Surfels, neighbourhoods: &Neighbourhoods, rows: &[Row], indirect: &mut Vec<Vec3>) {
    for _ in 0..DESPECKLING {
        *indirect = (0..rows.len()).into_par_iter().map(|i| despeckled(neighbourhoods, indirect, i)).collect();
    }
    let passes = |(surfel, row): (&Surfel, &Row)| {
        let reach = REACH_SHARE / (SPREAD_OF_PASS * surfel.spacing_m * row.nearness_per_m.max(1e-6));
        (reach * reach).clamp(*PASSES.start(), *PASSES.end()) as u32
    };
    let passes: Vec<u32> = surfels.list.iter().zip(rows).map(passes).collect();
    for pass in 0..*PASSES.end() as u32 {
        let averaged = |i: usize| if pass < passes[i] { neighbourhoods.mean(i, indirect) } else { indirect[i] };
        *indirect = (0..rows.len()).into_par_iter().map(averaged).collect();
    }
    // Corrections for what is sampled leave less than nothing here and there.
    indirect.iter_mut().for_each(|light| *light = light.max(Vec3::ZERO));
}

/// Without what one lucky ray found, where a surfel is far brighter than all around it, and with what a correction took too
/// much, where it is far darker.
fn despeckled(neighbourhoods: &Neighbourhoods, indirect: &[Vec3], i: usize) -> Vec3 {
    /// Real light from elsewhere changes by less from surfel to surfel.
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
