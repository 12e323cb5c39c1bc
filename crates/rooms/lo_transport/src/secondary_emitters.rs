//! Secondary emitters: sheets lit from behind, and surfaces so bright that few gather rays would find them. They are
//! sampled like lamps.

use lo_geometry::Vec3;
use lo_mesh::Hit;

use crate::light_sampler::{LightSampler, SurfelRadiance};
use crate::lights::{Emitters, luminance};
use crate::surface_samples::SurfaceSample;
use crate::surfels::Surfels;
use crate::traced_world::TracedWorld;

/// Surfaces brighter than the geometric mean by this factor are sampled like lamps.
const BRIGHTNESS_RATIO: f32 = 12.0;

/// Maximum edge length of a piece of a glowing sheet.
const SHEET_PIECE_M: f32 = 0.15;

/// Adds the sheets lit from behind as emitters, given the transmitted radiance of each surfel.
pub(crate) fn push_sheets(world: &TracedWorld, surfels: &Surfels, glow: &[Vec3], emitters: &mut Emitters) {
    let model = world.prepared.model();
    for triangle in 0..model.triangles.len() as u32 {
        let material = &model.materials[model.triangle_materials[triangle as usize] as usize];
        if material.diffuse_transmission <= 0.0 || material.emissive != [0.0; 3] {
            continue;
        }
        let component = surfels.component(triangle);
        emitters.push_triangle(
            world,
            triangle,
            SHEET_PIECE_M,
            |emitter, _| {
                emitter.sheet = true;
                let center = emitter.corner + (emitter.edges[0] + emitter.edges[1]) / 3.0;
                emitter.radiance = [emitter.normal, -emitter.normal]
                    .map(|normal| surfels.near(center, normal, component).mean(|surfel| glow[surfel]));
            },
            false,
        );
    }
}

/// Builds a sampler of surfaces much brighter than the rest: sunlit, near a lamp, under the open sky. `leaving`
/// estimates the radiance leaving each surfel. The exchange corrects errors of the estimate.
pub(crate) fn secondary_emitters<'s>(
    world: &TracedWorld,
    surfels: &'s Surfels,
    lighting: &LightSampler,
    leaving: Vec<Vec3>,
) -> LightSampler<'s> {
    let lit = leaving.iter().map(|&l| luminance(l)).zip(&surfels.list).filter(|(l, _)| *l > 0.0);
    let areas = lit.map(|(l, surfel)| (f64::from(l), f64::from(surfel.area_m2())));
    let (sum, area) = areas.fold((0.0, 0.0), |(sum, total), (l, area)| (sum + l.ln() * area, total + area));
    let least = (f64::from(BRIGHTNESS_RATIO) * (sum / area.max(f64::MIN_POSITIVE)).exp()) as f32;
    let bright: Vec<bool> = leaving.iter().map(|&light| luminance(light) > least).collect();
    let emitters = pieces(world, surfels, lighting, &leaving, &bright);
    LightSampler { surfel_radiance: Some(SurfelRadiance { surfels, leaving }), ..LightSampler::new(emitters) }
}

/// Builds emitters from the triangles near bright surfels.
fn pieces(
    world: &TracedWorld,
    surfels: &Surfels,
    lighting: &LightSampler,
    leaving: &[Vec3],
    bright: &[bool],
) -> Emitters {
    let triangles = world.prepared.model().triangles.len();
    let mut wanted = vec![false; triangles];
    for (surfel, _) in surfels.list.iter().zip(bright).filter(|(_, bright)| **bright) {
        wanted[surfel.sample.triangle as usize] = true;
    }
    // Triangles smaller than the spacing may have no surfel of their own.
    let center = |triangle: u32| SurfaceSample::both_sides(world, triangle, [1.0 / 3.0; 2]);
    let bright_at = |sample: &SurfaceSample| {
        let surfel = surfels.nearest(sample.position, sample.normal, surfels.component(sample.triangle));
        surfel.filter(|&surfel| bright[surfel as usize])
    };
    let mut emitters = Emitters::none(world);
    let mut sums: Vec<[(Vec3, f32); 2]> = Vec::new();
    for triangle in (0..triangles as u32).filter(|&t| !lighting.emitters.holds(t) || world.is_lamp(t)) {
        let sides = center(triangle).map(|sides| sides.map(|sample| bright_at(&sample)));
        let Some(sides) = sides.filter(|sides| wanted[triangle as usize] || *sides != [None; 2]) else { continue };
        emitters.push_triangle(
            world,
            triangle,
            SHEET_PIECE_M,
            |emitter, _| {
                emitter.radiance = [Vec3::ONE; 2];
            },
            false,
        );
        sums.resize(emitters.list.len(), [(Vec3::ZERO, 0.0); 2]);
        let middle = Hit { distance_m: 0.0, triangle, barycentric: [1.0 / 3.0; 2] };
        if let Some(piece) = emitters.of(&middle) {
            for (sum, surfel) in sums[piece as usize].iter_mut().zip(sides) {
                let light = surfel.map_or(Vec3::ZERO, |surfel| leaving[surfel as usize]);
                *sum = (sum.0 + light, sum.1 + f32::from(u8::from(surfel.is_some())));
            }
        }
    }
    for (i, surfel) in surfels.list.iter().enumerate().filter(|(i, _)| bright[*i]) {
        for sample in surfel.sample.around(world, 0.6 * surfel.spacing_m) {
            let hit = Hit { distance_m: 0.0, triangle: sample.triangle, barycentric: sample.barycentric };
            let Some(piece) = emitters.of(&hit) else { continue };
            let back = emitters.list[piece as usize].normal.dot(surfel.normal) < 0.0;
            let sum = &mut sums[piece as usize][usize::from(back)];
            *sum = (sum.0 + leaving[i], sum.1 + 1.0);
        }
    }
    for (emitter, sums) in emitters.list.iter_mut().zip(sums) {
        emitter.radiance = sums.map(|(sum, count)| sum / count.max(1.0));
    }
    emitters
}
