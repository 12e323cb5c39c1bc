//! Finds the surfels that light can reach. Excludes insides of solids, surfaces flat against others, and the outside of
//! the house.

use lo_geometry::{Ray, Vec3, cosine_hemisphere, orthonormal_basis};
use lo_mesh::offset_origin;
use rayon::prelude::*;

use crate::lights::{Emitter, EmitterShape, Emitters};
use crate::pattern::{self, Rotations};
use crate::surfels::Surfels;
use crate::traced_world::TracedWorld;

/// Rays per surfel that search for further surfels.
const SEARCH_RAYS: usize = 16;

/// A surfel is in a gap if more than half of its rays end within this share of the spacing.
const GAP_SHARE: f32 = 0.25;

/// Minimum gap width, however small the spacing: between a lamp and its socket.
const MIN_GAP_M: f32 = 0.008;

/// Minimum number of rays from all lights together. Each emitter sends at least four.
const MIN_LIGHT_RAYS: f32 = 20_000.0;

/// Maximum number of panes and mirrors along a path.
const MAX_MIRRORS: u32 = 8;

/// Propagates light from the emitters and from surfel to surfel. `others` are the surfels on the other side of sheets.
pub(crate) fn reachable(world: &TracedWorld, surfels: &Surfels, emitters: &Emitters, others: &[u32]) -> Vec<bool> {
    let count = surfels.list.len();
    let sky = &world.sky;
    if sky.portals.is_empty() && (sky.sun.is_some() || !sky.is_dark()) {
        // The open world is lit from all sides.
        return vec![true; count];
    }
    let rotations = Rotations::new("transport reach", 0);
    let directions = cosine_hemisphere(SEARCH_RAYS);
    let mut reachable = vec![false; count];
    let total: f32 = emitters.list.iter().map(Emitter::weight).sum();
    let by_lights: Vec<Vec<u32>> = emitters
        .list
        .par_iter()
        .enumerate()
        .map(|(i, emitter)| {
            let rays =
                (MIN_LIGHT_RAYS * emitter.weight() / total.max(f32::MIN_POSITIVE)).ceil().clamp(4.0, MIN_LIGHT_RAYS);
            let mut found = Vec::new();
            for k in 0..rays as u32 {
                for ray in leaving(emitter, k, rays as u32, rotations.of(i)) {
                    follow(world, surfels, others, ray, &mut found);
                }
            }
            found
        })
        .chain(sky.portals.par_iter().enumerate().map(|(i, opening)| {
            // The sun's beam is narrow and needs its own rays.
            let mut found = Vec::new();
            for k in 0..sky.sun.as_ref().map_or(0, |_| 256) {
                let Some(disc) = &sky.sun else { break };
                let uv = pattern::r2(k) + lo_geometry::Vec2::from_slice(&rotations.of(i)[..2]);
                let [a, b] = opening.portal.edges;
                let origin = opening.portal.corner + a * uv.x.fract() + b * uv.y.fract();
                if disc.sun.direction.dot(opening.normal) < 0.0 {
                    follow(world, surfels, others, Ray { origin, direction: -disc.sun.direction }, &mut found);
                }
            }
            found
        }))
        .collect();
    let (mut fresh, mut in_gaps) = (Vec::new(), Vec::new());
    let mut mark = |found: Vec<u32>, next: &mut Vec<u32>| {
        for surfel in found {
            if !std::mem::replace(&mut reachable[surfel as usize], true) {
                next.push(surfel);
            }
        }
    };
    by_lights.into_iter().for_each(|found| mark(found, &mut fresh));
    while !fresh.is_empty() {
        let search = |&i: &u32| {
            let surfel = &surfels.list[i as usize];
            let turn = lo_geometry::Mat3::from_rotation_z(std::f32::consts::TAU * rotations.of(i as usize)[0]);
            let basis = orthonormal_basis(surfel.normal) * turn;
            let origin = offset_origin(surfel.position, surfel.normal);
            // Cloth hangs in folds finer than surfels, and light enters them.
            let is_cloth = surfel.scattering.through != Vec3::ZERO;
            let gap_m = if is_cloth { MIN_GAP_M } else { MIN_GAP_M.max(GAP_SHARE * surfel.spacing_m) };
            let (mut found, mut blocked) = (Vec::new(), 0);
            for &local in &directions {
                let ray = Ray { origin, direction: basis * local };
                let distance_m = follow(world, surfels, others, ray, &mut found);
                blocked += usize::from(distance_m < gap_m);
            }
            if 2 * blocked > SEARCH_RAYS { None } else { Some(found) }
        };
        let found: Vec<Option<Vec<u32>>> = fresh.par_iter().map(search).collect();
        let mut next = Vec::new();
        for (surfel, found) in fresh.into_iter().zip(found) {
            match found {
                Some(found) => mark(found, &mut next),
                None => in_gaps.push(surfel),
            }
        }
        fresh = next;
    }
    in_gaps.into_iter().for_each(|surfel| reachable[surfel as usize] = false);
    reachable
}

/// Returns rays that carry an emitter's light, from each side that emits.
fn leaving(emitter: &Emitter, k: u32, count: u32, rotation: [f32; 4]) -> impl Iterator<Item = Ray> {
    let uv = pattern::r2(k);
    let [mut x, mut y] = [(uv.x + rotation[0]).fract(), (uv.y + rotation[1]).fract()];
    if emitter.shape != EmitterShape::Portal && x + y > 1.0 {
        [x, y] = [1.0 - x, 1.0 - y];
    }
    let point = emitter.corner + emitter.edges[0] * x + emitter.edges[1] * y;
    let radius2 = (k as f32 + 0.5) / count as f32;
    let (sin, cos) = (std::f32::consts::TAU * (lo_geometry::van_der_corput(k) + rotation[2])).sin_cos();
    let local = Vec3::new(radius2.sqrt() * cos, radius2.sqrt() * sin, (1.0 - radius2).sqrt());
    [emitter.normal, -emitter.normal].into_iter().zip(emitter.radiance).filter(|(_, r)| *r != Vec3::ZERO).map(
        move |(normal, _)| Ray { origin: offset_origin(point, normal), direction: orthonormal_basis(normal) * local },
    )
}

/// Collects the surfels that a ray hits. Returns the distance to the first surface, or infinity.
fn follow(world: &TracedWorld, surfels: &Surfels, others: &[u32], mut ray: Ray, found: &mut Vec<u32>) -> f32 {
    let mut first_m = f32::INFINITY;
    for _ in 0..MAX_MIRRORS {
        let Some(hit) = world.hit(&ray) else { break };
        first_m = first_m.min(hit.distance_m);
        let surface = world.interaction(&hit, &ray, 0.0);
        let near = surfels.near(surface.position, surface.geometric_normal, surfels.component(surface.triangle));
        for &(surfel, _) in near.as_slice() {
            found.push(surfel);
            found.extend(Some(others[surfel as usize]).filter(|&other| other != u32::MAX));
        }
        if surface.pass != Vec3::ZERO {
            ray = surface.ray(ray.direction);
        } else if surface.mirror.max_element() > 0.5 {
            ray = surface.ray(surface.mirrored());
        } else {
            break;
        }
    }
    first_m
}
