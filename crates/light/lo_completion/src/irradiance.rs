//! Light that comes in at places on surfaces, by cones through an octree.

use std::f32::consts::PI;

use lo_cone::{Cone, ConeSample, ConeTracer, Settings};
use lo_geometry::{Vec3, cosine_hemisphere, orthonormal_basis};
use lo_octree::LightOctree;

/// Cones per place, and the tangent of their half-angle: together they cover the hemisphere.
const CONES: usize = 64;
const TAN_HALF_ANGLE: f32 = 0.15;

/// Places lie so many leaves before the surface, outside of its own leaves.
const OFFSET: f32 = 1.5;

/// A place on a surface, and the unit normal there.
pub(crate) type Place = (Vec3, Vec3);

/// Distance from the surface at which light is gathered, metres.
pub(crate) fn offset_m(light: &LightOctree) -> f32 {
    OFFSET * light.cube.node_edge_m(light.octree.depth())
}

/// For an octree without lobes.
pub(crate) fn tracer(light: &LightOctree) -> ConeTracer {
    ConeTracer::new(light, Settings::default()).expect("the usual settings are valid, and there are no lobes")
}

/// Irradiance by channel of places on surfaces, each with the unit normal there. Where nodes have lobes, light is as it is seen from the first of them.
pub fn irradiance_at(light: &LightOctree, places: &[(Vec3, Vec3)]) -> Vec<Vec3> {
    let Some(&(first_m, _)) = places.first() else { return Vec::new() };
    let light = light.seen_from(first_m);
    irradiances(&tracer(&light), places.iter().copied(), offset_m(&light))
}

/// Irradiance of each place, by channel.
pub(crate) fn irradiances(tracer: &ConeTracer, places: impl Iterator<Item = Place>, offset_m: f32) -> Vec<Vec3> {
    let directions = cosine_hemisphere(CONES);
    let cones_of = |(position_m, normal): Place| {
        let (basis, origin) = (orthonormal_basis(normal), position_m + offset_m * normal);
        directions.iter().map(move |&d| Cone { origin, direction: basis * d, tan_half_angle: TAN_HALF_ANGLE })
    };
    let cones: Vec<Cone> = places.flat_map(cones_of).collect();
    let mut samples = vec![ConeSample::default(); cones.len()];
    tracer.trace_batch(&cones, &mut samples);
    let mean = |samples: &[ConeSample]| samples.iter().map(|s| Vec3::from(s.radiance)).sum::<Vec3>() / CONES as f32;
    samples.chunks(CONES).map(|samples| PI * mean(samples)).collect()
}
