//! Irradiance at surface points, by cones through an octree.

use std::f32::consts::PI;

use lo_cone::{Cone, ConeSample, ConeTracer, Settings};
use lo_geometry::{Vec3, cosine_hemisphere, orthonormal_basis};
use lo_octree::LightOctree;

/// Cones per point, and the tangent of their half-angle: together they cover the hemisphere.
const CONES: usize = 64;
const TAN_HALF_ANGLE: f32 = 0.15;

/// Offset of the apexes from the surface, in leaf edges: outside the surface's own leaves.
const OFFSET: f32 = 1.5;

/// A surface point with its unit normal.
pub(crate) type SurfacePoint = (Vec3, Vec3);

/// Returns the distance from the surface at which light is gathered, in metres.
pub(crate) fn offset_m(light: &LightOctree) -> f32 {
    OFFSET * light.cube.node_edge_m(light.octree.depth())
}

/// Creates a tracer for an octree without lobes.
pub(crate) fn tracer(light: &LightOctree) -> ConeTracer {
    ConeTracer::new(light, Settings::default()).expect("default settings are valid, and there are no lobes")
}

/// Returns the irradiance per channel at surface points, each with its unit normal. If nodes have lobes, light is as
/// seen from the first point.
pub fn irradiance_at(light: &LightOctree, points: &[(Vec3, Vec3)]) -> Vec<Vec3> {
    let Some(&(first_m, _)) = points.first() else { return Vec::new() };
    let light = light.seen_from(first_m);
    irradiances(&tracer(&light), points.iter().copied(), offset_m(&light))
}

/// Returns the irradiance per channel at each point.
pub(crate) fn irradiances(tracer: &ConeTracer, points: impl Iterator<Item = SurfacePoint>, offset_m: f32) -> Vec<Vec3> {
    let directions = cosine_hemisphere(CONES);
    let cones_of = |(position_m, normal): SurfacePoint| {
        let (basis, origin) = (orthonormal_basis(normal), position_m + offset_m * normal);
        directions.iter().map(move |&d| Cone { origin, direction: basis * d, tan_half_angle: TAN_HALF_ANGLE })
    };
    let cones: Vec<Cone> = points.flat_map(cones_of).collect();
    let mut samples = vec![ConeSample::default(); cones.len()];
    tracer.trace_batch(&cones, &mut samples);
    let mean = |samples: &[ConeSample]| samples.iter().map(|s| Vec3::from(s.radiance)).sum::<Vec3>() / CONES as f32;
    samples.chunks(CONES).map(|samples| PI * mean(samples)).collect()
}
