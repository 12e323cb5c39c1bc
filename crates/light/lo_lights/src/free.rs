use lo_cone::ConeSample;

/// Leaf edges that something must end before a light to be in its way, from which on and up to which the light is less seen: a surface's leaves are met
/// up to about two edges before its middle.
const BEFORE_EDGES: (f32, f32) = (2.5, 4.5);

/// Share of the way to a light that what a cone met leaves free: 1 where `sample` met something behind the light, or nothing. Between, what is met
/// may be the light's own leaf.
pub fn free_share(distance_m: f32, sample: &ConeSample, leaf_edge_m: f32) -> f32 {
    // From outside of the octree nothing is known to be in the way.
    if sample.opacity == 0.0 {
        return 1.0;
    }
    let missing = (distance_m - sample.distance_m) / leaf_edge_m;
    (1.0 - (missing - BEFORE_EDGES.0) / (BEFORE_EDGES.1 - BEFORE_EDGES.0)).clamp(0.0, 1.0)
}
