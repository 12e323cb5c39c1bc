use lo_cone::ConeSample;

/// Distances, in leaf edges, between an occluder and the light behind it over which the light's visibility falls to 0.
/// Cones hit the leaves of a surface up to about two edges before its centre.
const BEFORE_EDGES: (f32, f32) = (2.5, 4.5);

/// Returns the unoccluded share of a light at `distance_m`, given the cone sample towards it.
///
/// It is 1 where `sample` hit something behind the light, or nothing. In between, the hit may be the light's own leaf.
pub fn unoccluded_share(distance_m: f32, sample: &ConeSample, leaf_edge_m: f32) -> f32 {
    // Outside the octree there are no known occluders.
    if sample.opacity == 0.0 {
        return 1.0;
    }
    let missing = (distance_m - sample.distance_m) / leaf_edge_m;
    (1.0 - (missing - BEFORE_EDGES.0) / (BEFORE_EDGES.1 - BEFORE_EDGES.0)).clamp(0.0, 1.0)
}
