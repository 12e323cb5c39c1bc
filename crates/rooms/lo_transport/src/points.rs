//! Radiance at points that fill the leaves of an octree.

use std::f32::consts::PI;

use lo_geometry::{Ray, Vec3, cosine_hemisphere, orthonormal_basis};
use lo_octree::{Provenance, RadiancePoint};
use rayon::prelude::*;
use rustc_hash::FxHashMap;

use crate::baked::BakedWorld;
use crate::fineness::Fineness;
use crate::pattern::Rotations;
use crate::places::{self, Place};
use crate::sky::Opening;
use crate::transfer;

/// Points per square of a leaf's size. With half of them a leaf's count says too little of how much surface it holds
/// ([`lo_octree::LightOctree::from_uniform_points`]).
const PER_LEAF: f64 = 8.0;

/// Radiance at points that lie evenly on surfaces.
#[derive(Clone, Debug, PartialEq)]
pub struct SurfacePoints {
    /// The points.
    pub points: Vec<RadiancePoint>,
    /// Surface that each one stands for.
    pub area_m2: f32,
}

/// A surface that lets this share of light straight through is left out: what is behind it is seen.
const CLEAR: f32 = 0.5;

/// Points with less than this share of the free space that another one of the same leaf has in view do not count.
const HIDDEN_SHARE: f32 = 0.25;

/// Rays into the room from each point of a portal.
const PORTAL_RAYS: usize = 16;

/// Most points of one portal along each edge: bounds what a huge one can cost.
const MAX_PORTAL_POINTS: f32 = 500.0;

/// Portals that see less free space than this (a mean cube of the distance) are covered.
const COVERED_M3: f32 = 0.1;

/// Farther away nobody looks out of a portal.
const MAX_VIEWER_M: f32 = 5.0;

impl BakedWorld {
    /// Radiance leaving all surfaces that light reaches, both sides of thin sheets, as the mean over the directions of
    /// each side. Every octree leaf of edge `leaf_m` that such a surface crosses holds a point, but for corners that it
    /// barely touches.
    pub fn radiance_points(&self, leaf_m: f32) -> SurfacePoints {
        spread(self, leaf_m)
    }
}

fn spread(baked: &BakedWorld, leaf_m: f32) -> SurfacePoints {
    let area_m2: f64 = places::areas(baked.world().prepared.model()).iter().sum();
    let per_m2 = (PER_LEAF / f64::from(leaf_m * leaf_m).max(1e-12)).min(places::MAX_PLACES / area_m2.max(1e-9));
    let even = Fineness::even(leaf_m);
    let surfaces = places::spread(baked.world(), per_m2, &even)
        .flat_map_iter(|places| places.into_iter().filter_map(|place| on_surface(baked, place, leaf_m)));
    let mut points = without_hidden(surfaces.collect(), leaf_m);
    for opening in &baked.world().sky.portals {
        points.extend(in_portal(baked, opening, leaf_m));
    }
    SurfacePoints { points, area_m2: (1.0 / per_m2) as f32 }
}

/// The points but those that are hardly seen beside others of a leaf: the insides of cupboards, the floor under a rug.
fn without_hidden(points: Vec<(RadiancePoint, f32)>, leaf_m: f32) -> Vec<RadiancePoint> {
    let cell = |position: Vec3| (position / leaf_m).floor().to_array().map(|v| v as i32);
    let mut most: FxHashMap<[i32; 3], f32> = FxHashMap::default();
    for (point, open_m3) in &points {
        let open = most.entry(cell(point.position_m)).or_default();
        *open = open.max(*open_m3);
    }
    // Where the leaves of an octree will begin is not known: they may reach half a leaf into the next cells.
    let beside = |position: Vec3| {
        let corner = cell(position - Vec3::splat(0.5 * leaf_m));
        let cells = (0..8).map(move |k| [corner[0] + (k & 1), corner[1] + (k >> 1 & 1), corner[2] + (k >> 2)]);
        cells.filter_map(|cell| most.get(&cell)).fold(0.0, |most: f32, open| most.max(*open))
    };
    let seen = |(point, open_m3): &(RadiancePoint, f32)| *open_m3 >= HIDDEN_SHARE * beside(point.position_m);
    points.par_iter().filter(|point| seen(point)).map(|(point, _)| *point).collect()
}

fn point(position_m: Vec3, radiance: Vec3) -> RadiancePoint {
    RadiancePoint { position_m, radiance: radiance.to_array(), provenance: Provenance::Inferred }
}

/// The mean over directions of the light leaving a place, and how much free space it has in view; nothing where nobody sees it.
fn on_surface(baked: &BakedWorld, place: Place, leaf_m: f32) -> Option<(RadiancePoint, f32)> {
    let cache = baked.cache();
    let part = cache.surfels.part(place.triangle);
    let near = cache.surfels.near(place.position, place.normal, part);
    let surface = place.surface(baked.world(), leaf_m);
    let dark = surface.emission.max_element() <= 0.0;
    let unseen = near.best().is_none() || cache.surfels.is_inside(&place);
    if (unseen && dark) || surface.pass.max_element() > CLEAR {
        return None;
    }
    let arriving = near.mean(|surfel| cache.direct[surfel] + cache.indirect[surfel]);
    let behind = near.mean(|surfel| cache.behind[surfel]);
    let scatter = transfer::scatter(&surface);
    let radiance = (arriving * scatter.reflected + behind * scatter.through) / PI + surface.emission;
    let open_m3 = near.mean(|surfel| Vec3::splat(cache.open_m3[surfel])).x;
    Some((point(place.position, radiance), open_m3))
}

/// Outdoors as the room sees it: at each point the mean over viewers anywhere in the free space before the portal.
fn in_portal(baked: &BakedWorld, opening: &Opening, leaf_m: f32) -> Vec<RadiancePoint> {
    let edges = opening.portal.edges;
    let rotations = Rotations::new("transport portal points", baked.settings().seed);
    let per_leaf_edge = PER_LEAF.sqrt() as f32;
    let counts =
        edges.map(|edge| (per_leaf_edge * edge.length() / leaf_m).ceil().clamp(1.0, MAX_PORTAL_POINTS) as usize);
    let pattern = cosine_hemisphere(PORTAL_RAYS);
    let light = |i: usize| {
        let [u, v] = [i % counts[0], i / counts[0]];
        let [u, v] = [(u as f32 + 0.5) / counts[0] as f32, (v as f32 + 0.5) / counts[1] as f32];
        let position = opening.portal.corner + edges[0] * u + edges[1] * v;
        let turn = lo_geometry::Mat3::from_rotation_z(std::f32::consts::TAU * rotations.of(i)[0]);
        let basis = orthonormal_basis(opening.normal) * turn;
        let (mut sum, mut weights) = (Vec3::ZERO, 0.0);
        for &local in &pattern {
            let direction = basis * local;
            let (passed, free_m) = look_in(baked, Ray { origin: position, direction });
            // Viewers along the ray are as many as there is room for.
            let weight = free_m.min(MAX_VIEWER_M).powi(3);
            sum += baked.world().sky.radiance(-direction) * passed * weight;
            weights += weight;
        }
        (weights > COVERED_M3 * PORTAL_RAYS as f32).then(|| point(position, sum / weights))
    };
    (0..counts[0] * counts[1]).into_par_iter().filter_map(light).collect()
}

/// What clear panes leave of light along a ray into the room, and how far it goes.
fn look_in(baked: &BakedWorld, mut ray: Ray) -> (Vec3, f32) {
    const MAX_PANES: u32 = 8;
    let (mut passed, mut free_m) = (Vec3::ONE, 0.0);
    for _ in 0..MAX_PANES {
        let Some(hit) = baked.world().hit(&ray) else { return (passed, 0.0) };
        free_m += hit.distance_m;
        let surface = baked.world().surface(&hit, &ray, 0.0);
        if surface.pass.max_element() <= CLEAR {
            break;
        }
        passed *= surface.pass;
        ray = surface.ray(ray.direction);
    }
    (passed, free_m)
}
