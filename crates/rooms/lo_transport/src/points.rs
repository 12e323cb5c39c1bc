//! Radiance at surface points, from which octrees are built.

use std::f32::consts::PI;

use lo_geometry::{Ray, Vec3, cosine_hemisphere, orthonormal_basis};
use lo_octree::{Provenance, RadiancePoint};
use rayon::prelude::*;
use rustc_hash::FxHashMap;

use crate::baked::BakedWorld;
use crate::pattern::Rotations;
use crate::refinement::Refinement;
use crate::sky::PreparedPortal;
use crate::surface_samples::{self, SurfaceSample};
use crate::transfer;

/// Points per leaf face. With half as many, a leaf's point count does not reliably measure its surface area
/// ([`lo_octree::LightOctree::from_uniform_points`]).
const POINTS_PER_FACE: f64 = 8.0;

/// Radiance at evenly distributed surface points.
#[derive(Clone, Debug, PartialEq)]
pub struct SurfacePoints {
    /// Points with the mean radiance leaving their side of the surface.
    pub points: Vec<RadiancePoint>,
    /// Surface area per point, in m².
    pub area_m2: f32,
}

/// Surfaces that transmit at least this share of light unscattered are left out, since what is behind them is visible.
const MIN_CLEAR: f32 = 0.5;

/// Points are dropped if their free space is less than this share of the largest free space in the same leaf.
const HIDDEN_SHARE: f32 = 0.25;

/// Rays into the room per portal point.
const PORTAL_RAYS: usize = 16;

/// Maximum points of a portal along each edge. Bounds the cost of huge portals.
const MAX_PORTAL_POINTS: f32 = 500.0;

/// Portal points with less free space (mean cubed distance) count as covered.
const MIN_FREE_M3: f32 = 0.1;

/// Largest distance from which a viewer is assumed to look out of a portal.
const MAX_VIEWER_M: f32 = 5.0;

impl BakedWorld {
    /// Returns the radiance leaving all surfaces that light reaches, averaged over the directions of each side. Thin
    /// sheets have points on both sides. Every octree leaf of edge `leaf_m` that such a surface crosses contains a
    /// point, except leaves that it barely touches.
    pub fn radiance_points(&self, leaf_m: f32) -> SurfacePoints {
        spread(self, leaf_m)
    }
}

fn spread(baked: &BakedWorld, leaf_m: f32) -> SurfacePoints {
    let area_m2: f64 = surface_samples::areas(baked.world().prepared.model()).iter().sum();
    let per_m2 =
        (POINTS_PER_FACE / f64::from(leaf_m * leaf_m).max(1e-12)).min(surface_samples::MAX_SAMPLES / area_m2.max(1e-9));
    let uniform = Refinement::uniform(leaf_m);
    let on_surfaces = surface_samples::distribute(baked.world(), per_m2, &uniform)
        .flat_map_iter(|samples| samples.into_iter().filter_map(|sample| on_surface(baked, sample, leaf_m)));
    let mut points = remove_hidden(on_surfaces.collect(), leaf_m);
    for opening in &baked.world().sky.portals {
        points.extend(in_portal(baked, opening, leaf_m));
    }
    SurfacePoints { points, area_m2: (1.0 / per_m2) as f32 }
}

/// Removes points that are hidden behind others of the same leaf: inside cupboards, on the floor under a rug.
fn remove_hidden(points: Vec<(RadiancePoint, f32)>, leaf_m: f32) -> Vec<RadiancePoint> {
    let cell = |position: Vec3| (position / leaf_m).floor().to_array().map(|v| v as i32);
    let mut most: FxHashMap<[i32; 3], f32> = FxHashMap::default();
    for (point, open_m3) in &points {
        let open = most.entry(cell(point.position_m)).or_default();
        *open = open.max(*open_m3);
    }
    // The octree's leaf grid is not known here. Leaves may extend half a leaf into the neighbouring cells.
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

/// Returns the mean radiance leaving a surface sample and its free space. `None` where no viewer can see it.
fn on_surface(baked: &BakedWorld, sample: SurfaceSample, leaf_m: f32) -> Option<(RadiancePoint, f32)> {
    let cache = baked.cache();
    let component = cache.surfels.component(sample.triangle);
    let near = cache.surfels.near(sample.position, sample.normal, component);
    let surface = sample.interaction(baked.world(), leaf_m);
    let dark = surface.emission.max_element() <= 0.0;
    let unseen = near.best().is_none() || cache.surfels.faces_solid(&sample);
    if (unseen && dark) || surface.pass.max_element() > MIN_CLEAR {
        return None;
    }
    let arriving = near.mean(|surfel| cache.direct[surfel] + cache.indirect[surfel]);
    let behind = near.mean(|surfel| cache.behind[surfel]);
    let scattering = transfer::mean_scattering(&surface);
    let radiance = (arriving * scattering.reflected + behind * scattering.through) / PI + surface.emission;
    let open_m3 = near.mean(|surfel| Vec3::splat(cache.open_m3[surfel])).x;
    Some((point(sample.position, radiance), open_m3))
}

/// Returns points in a portal with the outdoor radiance as seen from the room. Each point averages over viewers
/// anywhere in the free space in front of the portal.
fn in_portal(baked: &BakedWorld, opening: &PreparedPortal, leaf_m: f32) -> Vec<RadiancePoint> {
    let edges = opening.portal.edges;
    let rotations = Rotations::new("transport portal points", baked.settings().seed);
    let per_leaf_edge = POINTS_PER_FACE.sqrt() as f32;
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
            let (passed, free_m) = trace_inwards(baked, Ray { origin: position, direction });
            // The number of viewers along the ray is proportional to the free volume.
            let weight = free_m.min(MAX_VIEWER_M).powi(3);
            sum += baked.world().sky.radiance(-direction) * passed * weight;
            weights += weight;
        }
        (weights > MIN_FREE_M3 * PORTAL_RAYS as f32).then(|| point(position, sum / weights))
    };
    (0..counts[0] * counts[1]).into_par_iter().filter_map(light).collect()
}

/// Returns the transmittance of clear panes along a ray into the room, and the distance to the first opaque surface.
fn trace_inwards(baked: &BakedWorld, mut ray: Ray) -> (Vec3, f32) {
    const MAX_PANES: u32 = 8;
    let (mut passed, mut free_m) = (Vec3::ONE, 0.0);
    for _ in 0..MAX_PANES {
        let Some(hit) = baked.world().hit(&ray) else { return (passed, 0.0) };
        free_m += hit.distance_m;
        let surface = baked.world().interaction(&hit, &ray, 0.0);
        if surface.pass.max_element() <= MIN_CLEAR {
            break;
        }
        passed *= surface.pass;
        ray = surface.ray(ray.direction);
    }
    (passed, free_m)
}
