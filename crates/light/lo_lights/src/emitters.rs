//! Emitters of an octree: groups of leaves above the cap.

use std::collections::VecDeque;
use std::f32::consts::PI;

use lo_cone::{Cone, ConeTracer, Settings};
use lo_geometry::Vec3;
use lo_octree::LightOctree;
use lo_scene::{LitScene, Side};

use crate::cap::{cap_of, luminance};
use crate::colour::color_temperature_k;
use crate::kind::{LightKind, LightOrigin};
use crate::leaves::{Leaf, Leaves};
use crate::occlusion::unoccluded_share;
use crate::shape::{ClusterShape, ClusterSurface, LeafSurface};

/// Layers of leaves around those above the cap that still contain light of the emitter, from partly filled leaves and
/// blending.
const HALO_LAYERS: u8 = 2;

/// Greatest number of emitters in a room; weaker ones count as surfaces.
const MAX_EMITTERS: usize = 64;

/// Least share of all light that an emitter has, and that an observed emitter has: users expect to find what the photo
/// shows.
const MIN_FLUX_SHARE: f32 = 1e-3;
const MIN_SEEN_FLUX_SHARE: f32 = 1e-4;

/// Least area of a window in m², and its least colour temperature in kelvin: daylight is white in the photo, lamps are
/// warmer.
const MIN_WINDOW_M2: f32 = 0.25;
const MIN_WINDOW_K: f32 = 4000.0;

/// Sine of the greatest tilt of a window's direction from the horizontal.
const MAX_WINDOW_TILT: f32 = 0.5;

/// Greatest area in m² of a lamp that does not hang from the ceiling.
const MAX_LAMP_M2: f32 = 0.5;

/// An emitter found in an octree.
#[derive(Clone, Debug)]
pub struct Emitter {
    /// Name: `L` and the rank by flux.
    pub id: String,
    /// Source of the emitter.
    pub origin: LightOrigin,
    /// Kind of light, where it is clear.
    pub kind: LightKind,
    /// Position and shape.
    pub surface: ClusterSurface,
    /// Mean linear RGB radiance of the surface, by the opacity of its leaves.
    pub radiance: Vec3,
    /// Mean linear RGB radiance above that of the surroundings: the part that edits change.
    pub excess: Vec3,
    /// Share of the excess in the total light emitted by surfaces.
    pub flux_share: f32,
    /// Confidence, from 0 to 1. Light observed in the photo or a panorama has 1, the rest is predicted by a network.
    /// `None` without a prediction.
    pub certainty: Option<f32>,
    /// Leaves of the emitter and its halo.
    pub(crate) parts: Vec<EmitterLeaf>,
}

/// Contribution of an emitter to a leaf.
#[derive(Clone, Copy, Debug)]
pub(crate) struct EmitterLeaf {
    pub depth: usize,
    pub row: usize,
    /// Area in m² of the leaf's surface in the room, times its opacity.
    pub area_m2: f32,
    /// Share, per channel, of the leaf's linear RGB radiance above that of the emitter's surroundings.
    pub share: Vec3,
}

impl EmitterLeaf {
    /// Returns the linear RGB radiance above that of the emitter's surroundings, for the radiances of `light`.
    pub fn excess(&self, light: &LightOctree) -> Vec3 {
        let [r, g, b, _] = light.rgba[self.depth][self.row];
        self.share * Vec3::new(r, g, b)
    }
}

/// Finds the emitters of a scene's light, by descending flux. There are none where lamps and windows are at most
/// [`CAP`](crate::CAP) times as bright as the mean.
///
/// An emitter is a group of adjacent leaves above the cap. Its light is the excess of these, and of the two layers of
/// leaves around them, over the next layer. The result is deterministic, including names.
pub fn emitters(scene: &LitScene) -> Vec<Emitter> {
    let light = without_lobes(&scene.light);
    let tracer = tracer(&light);
    let leaves = Leaves::of(&light, &tracer);
    let cap = cap_of(&light);
    let groups = groups(&light, &leaves, |leaf| leaf.luminance() > cap);
    let halos = Halos::new(&light, &leaves, &groups);
    let dull = median(&leaves);
    let found = groups.iter().enumerate().filter_map(|(number, core)| {
        let parts = halos.parts(&leaves, number, dull);
        let mut found = emitter(scene, &leaves, core, parts)?;
        if visible_share(scene, &leaves, core, &tracer) >= 0.5 {
            found.origin = LightOrigin::Observed;
        }
        Some(found)
    });
    ranked(found.collect())
}

/// Returns the total light emitted by surfaces, π L A, where luminance 1 over 1 m² and 1 sr counts 1.
fn emitted_light(leaves: &Leaves) -> f32 {
    PI * leaves.all.iter().map(|leaf| leaf.luminance() * leaf.emitting_area_m2()).sum::<f32>()
}

fn without_lobes(light: &LightOctree) -> LightOctree {
    LightOctree { lobes: None, ..light.clone() }
}

pub(crate) fn tracer(light: &LightOctree) -> ConeTracer {
    ConeTracer::new(light, Settings::default()).expect("default settings are valid, and there are no lobes")
}

/// Groups adjacent leaves that are `lit`, each group in leaf order.
fn groups(light: &LightOctree, leaves: &Leaves, lit: impl Fn(&Leaf) -> bool) -> Vec<Vec<usize>> {
    let mut open: Vec<bool> = leaves.all.iter().map(lit).collect();
    let mut groups = Vec::new();
    let mut touching = Vec::new();
    for first in 0..leaves.all.len() {
        if !std::mem::take(&mut open[first]) {
            continue;
        }
        let mut group = vec![first];
        let mut next = 0;
        while let Some(&leaf) = group.get(next) {
            next += 1;
            touching.clear();
            leaves.touching(light, leaf, &mut touching);
            group.extend(touching.iter().copied().filter(|&i| std::mem::take(&mut open[i])));
        }
        group.sort_unstable();
        groups.push(group);
    }
    groups
}

/// Layers of leaves around groups; each leaf belongs to the nearest group.
struct Halos {
    /// For each group: its leaves with those of its halo, and the ring of leaves around them, which shows the
    /// surroundings without the emitter.
    groups: Vec<(Vec<usize>, Vec<usize>)>,
}

impl Halos {
    fn new(light: &LightOctree, leaves: &Leaves, groups: &[Vec<usize>]) -> Self {
        let mut found: Vec<(Vec<usize>, Vec<usize>)> = groups.iter().map(|group| (group.clone(), Vec::new())).collect();
        let mut reached = vec![false; leaves.all.len()];
        let mut queue = VecDeque::new();
        for (number, group) in groups.iter().enumerate() {
            for &leaf in group {
                reached[leaf] = true;
                queue.push_back((leaf, number, 0u8));
            }
        }
        let mut touching = Vec::new();
        while let Some((leaf, number, layer)) = queue.pop_front() {
            touching.clear();
            leaves.touching(light, leaf, &mut touching);
            for &next in &touching {
                if std::mem::replace(&mut reached[next], true) {
                    continue;
                }
                if layer < HALO_LAYERS {
                    found[number].0.push(next);
                    queue.push_back((next, number, layer + 1));
                } else {
                    found[number].1.push(next);
                }
            }
        }
        Self { groups: found }
    }

    /// Returns the excess of each leaf of a group over the ring around it, blended by the inverse fourth power of
    /// distance. `dull` is the fallback without a ring.
    fn parts(&self, leaves: &Leaves, number: usize, dull: Vec3) -> Vec<EmitterLeaf> {
        let (own, around) = &self.groups[number];
        let base = |leaf: &Leaf| {
            let mut sum = (Vec3::ZERO, 0.0);
            for ring in around.iter().map(|&i| &leaves.all[i]) {
                let squared = (ring.surface.centre_m - leaf.surface.centre_m).length_squared();
                let weight = ring.surface.edge_m.powi(2) / squared.powi(2).max(1e-12);
                sum.0 += ring.radiance * weight;
                sum.1 += weight;
            }
            if sum.1 > 0.0 { sum.0 / sum.1 } else { dull }
        };
        let of_leaf = |&i: &usize| {
            let leaf = &leaves.all[i];
            let base = base(leaf);
            let brighter = leaf.luminance() > luminance(base);
            part(leaf, if brighter { (leaf.radiance - base).max(Vec3::ZERO) } else { Vec3::ZERO })
        };
        own.iter().map(of_leaf).collect()
    }
}

fn part(leaf: &Leaf, excess: Vec3) -> EmitterLeaf {
    let share = excess / leaf.radiance.max(Vec3::splat(1e-12));
    EmitterLeaf { depth: leaf.depth as usize, row: leaf.row, area_m2: leaf.emitting_area_m2(), share }
}

/// Returns the radiance of the leaf of median luminance.
fn median(leaves: &Leaves) -> Vec3 {
    let mut order: Vec<usize> = (0..leaves.all.len()).collect();
    order.sort_by(|&a, &b| leaves.all[a].luminance().total_cmp(&leaves.all[b].luminance()));
    order.get(order.len() / 2).map_or(Vec3::ZERO, |&i| leaves.all[i].radiance)
}

/// Creates an emitter from the leaves of its shape and its parts; `None` if it has no surface in the room.
fn emitter(scene: &LitScene, leaves: &Leaves, core: &[usize], parts: Vec<EmitterLeaf>) -> Option<Emitter> {
    let members = || core.iter().map(|&i| &leaves.all[i]);
    let surfaces: Vec<LeafSurface> = members().map(|leaf| leaf.surface).collect();
    let surface = ClusterSurface::of(&surfaces)?;
    let mean = |value: &dyn Fn(&Leaf) -> Vec3| {
        members().map(|leaf| value(leaf) * leaf.surface.area_m2).sum::<Vec3>() / surface.area_m2
    };
    let radiance = mean(&|leaf| leaf.radiance * leaf.opacity);
    // Total light of its leaves and their halo, over the surface of the former.
    let excess = parts.iter().map(|part| part.excess(&scene.light) * part.area_m2).sum::<Vec3>() / surface.area_m2;
    let flux_share = PI * luminance(excess) * surface.area_m2 / emitted_light(leaves).max(1e-9);
    let share = |shares: &[Vec<u8>], leaf: &Leaf| f32::from(shares[leaf.depth as usize][leaf.row]) / 255.0;
    let panorama = scene.panorama.as_ref().map_or(0.0, |laid| mean(&|leaf| Vec3::splat(share(&laid.share, leaf))).x);
    let certain = |confidence: &Vec<Vec<u8>>| {
        let of_leaf = |leaf: &Leaf| {
            let known =
                share(&scene.light.seen, leaf) + scene.panorama.as_ref().map_or(0.0, |laid| share(&laid.share, leaf));
            Vec3::splat(known + (1.0 - known).max(0.0) * share(confidence, leaf))
        };
        mean(&of_leaf).x.clamp(0.0, 1.0)
    };
    let certainty = scene.confidence.as_ref().map(certain);
    let origin = if panorama >= 0.5 { LightOrigin::Panorama } else { LightOrigin::Inferred };
    let kind = kind(scene, &surface, radiance);
    Some(Emitter { id: String::new(), origin, kind, surface, radiance, excess, flux_share, certainty, parts })
}

/// Returns the share of the leaves' surface that the photo shows, with or without a depth reading: inside the photo and
/// unoccluded.
fn visible_share(scene: &LitScene, leaves: &Leaves, core: &[usize], tracer: &ConeTracer) -> f32 {
    let camera = &scene.frame.camera;
    let mut shares = (0.0, 0.0);
    for leaf in core.iter().map(|&i| &leaves.all[i]) {
        let LeafSurface { centre_m, edge_m, area_m2, .. } = leaf.surface;
        let distance_m = centre_m.length();
        let inside = camera.project(centre_m).is_some_and(|(u, v, _)| camera.contains(u, v)) && distance_m > edge_m;
        let free = inside.then(|| {
            let direction = centre_m / distance_m;
            let sample = tracer.trace(&Cone { origin: Vec3::ZERO, direction, tan_half_angle: 0.0 });
            unoccluded_share(distance_m, &sample, edge_m)
        });
        shares.0 += area_m2 * free.unwrap_or(0.0);
        shares.1 += area_m2;
    }
    shares.0 / f32::max(shares.1, 1e-9)
}

/// Classifies an emitter. A window is large, upright and of daylight colour; a lamp is small or shines down. Anything
/// else is a bright surface.
fn kind(scene: &LitScene, surface: &ClusterSurface, radiance: Vec3) -> LightKind {
    let up = scene.up();
    let ClusterShape::Panel { direction, .. } = surface.shape else {
        return if surface.area_m2 <= MAX_LAMP_M2 { LightKind::Lamp } else { LightKind::BrightSurface };
    };
    let rise = direction.dot(up);
    let day = color_temperature_k(radiance.to_array()).is_some_and(|kelvin| kelvin >= MIN_WINDOW_K);
    let ceiling = scene.room.as_ref().and_then(|room| room.planes.iter().find(|plane| plane.side == Side::Ceiling));
    let high = ceiling.is_none_or(|ceiling| ceiling.plane.signed_distance_m(surface.centre_m) < 0.5);
    if rise > MAX_WINDOW_TILT {
        LightKind::BrightSurface
    } else if rise.abs() <= MAX_WINDOW_TILT && surface.area_m2 >= MIN_WINDOW_M2 && day {
        LightKind::Window
    } else if surface.area_m2 <= MAX_LAMP_M2 || (rise < -MAX_WINDOW_TILT && high) {
        LightKind::Lamp
    } else {
        LightKind::BrightSurface
    }
}

/// Sorts emitters by descending flux, names them by rank and drops negligible ones.
fn ranked(mut found: Vec<Emitter>) -> Vec<Emitter> {
    let least = |origin| if origin == LightOrigin::Observed { MIN_SEEN_FLUX_SHARE } else { MIN_FLUX_SHARE };
    found.retain(|emitter| emitter.flux_share >= least(emitter.origin));
    found.sort_by(|a, b| b.flux_share.total_cmp(&a.flux_share));
    found.truncate(MAX_EMITTERS);
    for (rank, emitter) in found.iter_mut().enumerate() {
        emitter.id = format!("L{}", rank + 1);
    }
    found
}
