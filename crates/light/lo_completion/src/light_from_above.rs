//! Lamps outside the view in an octree that a network has completed: observed surfaces cannot reflect more light than
//! they receive.

use std::borrow::Cow;
use std::f32::consts::PI;

use lo_cone::ConeTracer;
use lo_geometry::{Vec3, smoothstep};
use lo_imaging::luminance;
use lo_octree::LightOctree;
use lo_scene::Surfel;

use crate::irradiance::{self, offset_m, tracer};
use crate::lamps::{LampReport, MAX_LIGHT, implied_irradiance, object_surfel};
use crate::layout::area;

/// Number of points at which irradiance is compared with observed radiance.
const RECEIVERS: usize = 256;

/// Share of the observed area that must receive as much as it reflects. The rest may be lamps, windows and highlights.
const EXPLAINED_SHARE: f32 = 0.75;

/// Cosines of the angles from the vertical between which the lamp fades: 5 and 12 degrees.
const FADE: (f32, f32) = (0.996, 0.978);

/// Least irradiance from a lamp of radiance 1: points that hardly see it must not imply an extreme lamp.
const MIN_PATCH: f32 = 1e-3;

/// Adds a soft, neutral lamp above the middle of the view, on unobserved surfaces, so that observed surfaces can be as
/// bright as they are.
///
/// Completion with the likeliest light omits lamps, since their positions are uncertain although their existence is
/// not. A diffuse surface of radiance L receives E ≥ π L, since its albedo is at most 1. The lamp is the weakest that
/// satisfies this for three quarters of the observed area (clipped pixels count with their lower bound). An
/// upward-facing surface in the middle of the view must not receive more than the shell's limit.
///
/// A baseline for [`fit_lamps`](crate::fit_lamps). If nodes have lobes, the octree becomes its view from the middle of
/// the observed surfaces.
pub fn light_from_above(light: &mut LightOctree, seen: &[Surfel], up: Vec3) -> LampReport {
    let Some(implied_irradiance) = implied_irradiance(seen) else { return LampReport::default() };
    let stride = seen.len().div_ceil(RECEIVERS).max(1);
    let receivers: Vec<Surfel> = seen.iter().skip(stride / 2).step_by(stride).copied().collect();
    let objects = |s: &Surfel| object_surfel(s, up);
    let objects: Vec<Surfel> = receivers.iter().map(objects).collect();
    let middle = objects.iter().map(|s| s.position_m).sum::<Vec3>() / objects.len().max(1) as f32;

    if let Cow::Owned(seen) = light.seen_from(middle) {
        *light = seen;
    }
    let weights = weights(light, middle, up);
    let of_row = |(rgba, &weight): (&[f32; 4], &f32)| [weight, weight, weight, rgba[3]];
    let rows = light.rgba.iter().zip(&weights);
    let patch = rows.map(|(rgba, weights)| rgba.iter().zip(weights).map(of_row).collect()).collect();
    let patch = LightOctree { rgba: patch, ..light.clone() };
    let (room, patch) = (tracer(light), tracer(&patch));
    let offset_m = offset_m(light);

    let (other, by_patch) = (irradiances(&room, &receivers, offset_m), irradiances(&patch, &receivers, offset_m));
    let asked = receivers
        .iter()
        .zip(&other)
        .zip(&by_patch)
        .map(|((seen, other), patch)| ((PI * luminance(seen.radiance) - other) / patch.max(MIN_PATCH), area(seen)));
    let asked = quantile(asked.collect(), EXPLAINED_SHARE);
    let above = mean(&irradiances(&patch, &objects, offset_m)).max(MIN_PATCH);
    let bearable = (MAX_LIGHT * implied_irradiance - mean(&irradiances(&room, &objects, offset_m))) / above;
    let lamp_radiance = asked.min(bearable).max(0.0);
    for (rgba, weight) in light.rgba.iter_mut().flatten().zip(weights.iter().flatten()) {
        for c in &mut rgba[..3] {
            *c += lamp_radiance * weight;
        }
    }
    LampReport { implied_irradiance, other_irradiance: mean(&other), lamp_radiance }
}

/// Returns the lamp's weight in each row: its unobserved share, by the angle from the vertical as seen from `middle`.
fn weights(light: &LightOctree, middle: Vec3, up: Vec3) -> Vec<Vec<f32>> {
    let levels = (0..).zip(light.octree.levels()).zip(&light.seen);
    let of_level = levels.map(|((depth, level), seen)| {
        let weight = |(key, &seen): (u32, &u8)| {
            let cos = (light.node_middle_m(depth, key) - middle).normalize_or_zero().dot(up);
            smoothstep(FADE.1, FADE.0, cos) * (1.0 - f32::from(seen) / 255.0)
        };
        level.row_keys().zip(seen).map(weight).collect()
    });
    of_level.collect()
}

/// Returns the luminance of the irradiance at each point.
fn irradiances(tracer: &ConeTracer, places: &[Surfel], offset_m: f32) -> Vec<f32> {
    let light = irradiance::irradiances(tracer, places.iter().map(|place| (place.position_m, place.normal)), offset_m);
    light.into_iter().map(|light| luminance(light.to_array())).collect()
}

fn mean(values: &[f32]) -> f32 {
    values.iter().sum::<f32>() / values.len().max(1) as f32
}

/// Returns the least value whose cumulative weight is at least this share of the total; 0 for an empty list.
fn quantile(mut weighted: Vec<(f32, f32)>, share: f32) -> f32 {
    weighted.sort_by(|a, b| a.0.total_cmp(&b.0));
    let least = share * weighted.iter().map(|(_, weight)| weight).sum::<f32>();
    let mut sum = 0.0;
    let enough = |(_, weight): &&(f32, f32)| {
        sum += weight;
        sum >= least
    };
    weighted.iter().find(enough).map_or(0.0, |(value, _)| *value)
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use lo_cone::{Cone, Settings};
    use lo_geometry::{Cube, cosine_hemisphere, orthonormal_basis};
    use lo_octree::{Provenance, RadiancePoint};

    use super::*;
    use crate::lamps::OBJECT_SHARE;
    use crate::warning::CompletionWarning;

    /// Half of the room's edge.
    const HALF_M: f32 = 2.0;

    /// A cubic room around the camera. Its faces have one radiance; its far wall, the only observed surface, has
    /// another.
    fn room(faces: f32, far_wall: f32) -> (LightOctree, Vec<Surfel>) {
        let (mut points, mut seen) = (Vec::new(), Vec::new());
        for face in 0..6 {
            let at = |i: usize| HALF_M * ((i as f32 + 0.5) / 40.0 - 1.0);
            for (i, j) in (0..80 * 80).map(|n| (n % 80, n / 80)) {
                let mut p = [at(i), at(j), if face < 3 { -HALF_M } else { HALF_M }];
                p.rotate_right(2 - face % 3);
                let far = face == 2;
                let (radiance, provenance) =
                    if far { ([far_wall; 3], Provenance::Observed) } else { ([faces; 3], Provenance::Inferred) };
                points.push(RadiancePoint { position_m: Vec3::from(p), radiance, provenance });
                if far {
                    let position_m = Vec3::from(p);
                    let (eye_m, depth_m) = (Vec3::ZERO, HALF_M);
                    seen.push(Surfel { position_m, normal: Vec3::Z, radiance, provenance, eye_m, depth_m });
                }
            }
        }
        let cube = Cube::centred(Vec3::ZERO, 2.2 * HALF_M);
        (LightOctree::from_points(&points, cube, 6, 3).unwrap().0, seen)
    }

    #[test]
    fn observed_surfaces_receive_as_much_as_they_reflect() {
        let (mut light, seen) = room(0.33, 0.4);
        let before = light.clone();
        let report = light_from_above(&mut light, &seen, Vec3::Y);
        // E = π √(0.4 / 0.5 · 0.4 / 0.85), by the shell's rule.
        assert!((report.implied_irradiance / (PI * (0.8f32 * 0.4 / 0.85).sqrt()) - 1.0).abs() < 1e-3, "{report:?}");
        assert!((report.other_irradiance / (PI * 0.33) - 1.0).abs() < 0.05, "{report:?}");
        assert_eq!(report.warning(), Some(CompletionWarning::AssumedLamp { radiance: report.lamp_radiance }));
        // By rays independent of the cones: three quarters of the wall receive π · 0.4.
        let tracer = ConeTracer::new(&light, Settings::default()).unwrap();
        let irradiance = |origin: Vec3, normal: Vec3| {
            let basis = orthonormal_basis(normal);
            let cone = |&d: &Vec3| Cone { origin, direction: basis * d, tan_half_angle: 0.02 };
            let rays = cosine_hemisphere(3000);
            PI * rays.iter().map(|d| tracer.trace(&cone(d)).radiance[1]).sum::<f32>() / 3000.0
        };
        let at = |i: usize| 1.8 * ((i as f32 + 0.5) / 4.0 - 1.0);
        let places = (0..64).map(|n| Vec3::new(at(n % 8), at(n / 8), -1.8));
        let explained = places.filter(|&place| irradiance(place, Vec3::Z) > PI * 0.4).count();
        assert!((40..58).contains(&explained), "{explained} of 64");
        // Only the ceiling has changed.
        let changed = |depth: usize, row: usize| light.rgba[depth][row] != before.rgba[depth][row];
        let finest = &light.octree.levels()[6];
        for (&key, &row) in finest.keys.iter().zip(&finest.rows).filter(|(_, row)| **row >= 0) {
            let y = light.node_middle_m(6, key).y;
            assert!(!changed(6, row as usize) || (y > 1.0 && light.seen[6][row as usize] == 0), "{y}");
        }
    }

    #[test]
    fn surfaces_below_the_lamp_do_not_get_too_much() {
        let (mut light, seen) = room(0.05, 0.4);
        let report = light_from_above(&mut light, &seen, Vec3::Y);
        let tracer = ConeTracer::new(&light, Settings::default()).unwrap();
        let at = |n: usize| OBJECT_SHARE * seen[n * seen.len() / 50].position_m;
        let up = |n: usize| Surfel { position_m: at(n), normal: Vec3::Y, ..seen[0] };
        let objects: Vec<Surfel> = (0..50).map(up).collect();
        let most = MAX_LIGHT * report.implied_irradiance;
        assert!((mean(&irradiances(&tracer, &objects, 0.1)) / most - 1.0).abs() < 0.15, "{most}");
    }

    #[test]
    fn lobes_count_as_they_are_seen_from_the_middle_of_the_view() {
        let (mut light, seen) = room(0.33, 0.4);
        let mut plain = light.clone();
        // All nodes emit mostly downwards: in the middle of the view, the ceiling is brighter than its mean.
        light.lobes = Some(light.rgba.iter().map(|rows| vec![[0.0, -2.0, 0.0]; rows.len()]).collect());
        let middle = OBJECT_SHARE * Vec3::new(0.0, 0.0, -HALF_M);
        let overhead = Vec3::Y * HALF_M;
        let ceiling = |light: &LightOctree| {
            let (depth, node) = light.locate(overhead, 6).unwrap();
            light.node_rgba(depth, node).unwrap()[1]
        };
        let before = ceiling(&light);
        light_from_above(&mut light, &seen, Vec3::Y);
        assert!(light.lobes.is_none());
        let towards = (middle - overhead).normalize();
        let gain = lo_octree::lobe_gain(Vec3::NEG_Y * 2.0, towards);
        assert!(ceiling(&light) > 0.95 * gain * before && gain > 2.0, "{} {gain}", ceiling(&light));
        // Brighter from above, it needs less of a lamp.
        light_from_above(&mut plain, &seen, Vec3::Y);
        assert!(ceiling(&light) - gain * before < ceiling(&plain) - before);
    }

    #[test]
    fn a_room_that_is_bright_enough_stays() {
        let (mut light, seen) = room(0.5, 0.4);
        let before = light.clone();
        let report = light_from_above(&mut light, &seen, Vec3::Y);
        assert_eq!((report.lamp_radiance, report.warning(), light), (0.0, None, before));
        assert_eq!(light_from_above(&mut room(0.5, 0.4).0, &[], Vec3::Y), LampReport::default());
    }
}
