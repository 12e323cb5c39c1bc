//! Radiance at points that fill the leaves of an octree.

use std::f32::consts::PI;

use octree::{Coverage, RadiancePoint};
use rayon::prelude::*;

use crate::baked::BakedWorld;
use crate::places::{self, Place};
use crate::transfer;

/// Points per square of a leaf's size.
const PER_LEAF: f64 = 4.0;

pub(crate) fn spread(baked: &BakedWorld, leaf_m: f32) -> Vec<RadiancePoint> {
    let (scene, cache) = (baked.scene(), baked.cache());
    let light = |place: Place| {
        let part = cache.surfels.part(place.triangle);
        let near = cache.surfels.near(place.position, place.normal, part);
        let surface = place.surface(scene, leaf_m);
        if near.best().is_none() && surface.emission.max_element() <= 0.0 {
            return None;
        }
        let arriving = near.mean(|surfel| cache.direct[surfel] + cache.indirect[surfel]);
        let behind = near.mean(|surfel| cache.behind[surfel]);
        let scatter = transfer::scatter(&surface);
        let radiance = (arriving * scatter.reflected + behind * scatter.through) / PI + surface.emission;
        Some(RadiancePoint { position_m: place.position, radiance: radiance.to_array(), coverage: Coverage::Inferred })
    };
    let per_m2 = PER_LEAF / f64::from(leaf_m * leaf_m).max(1e-12);
    places::spread(scene, per_m2).flat_map_iter(|places| places.into_iter().filter_map(light)).collect()
}
