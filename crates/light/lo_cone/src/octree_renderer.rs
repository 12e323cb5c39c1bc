use std::borrow::Cow;

use lo_geometry::Vec3;
use lo_octree::LightOctree;

use crate::{ConeTracer, Settings};

/// Renders a lighting octree from any viewpoint, with default settings.
///
/// One tracer serves all viewpoints. If nodes have directional lobes, a tracer is made for each viewpoint.
pub struct OctreeRenderer {
    tracers: Tracers,
}

enum Tracers {
    Shared(Box<ConeTracer>),
    PerViewpoint(Box<LightOctree>),
}

impl OctreeRenderer {
    /// Prepares an octree: copies it if it has lobes, otherwise converts it to a tracer.
    pub fn new(light: &LightOctree) -> Self {
        let tracers = match light.lobes {
            Some(_) => Tracers::PerViewpoint(Box::new(light.clone())),
            None => Tracers::Shared(Box::new(tracer(light))),
        };
        Self { tracers }
    }

    /// Returns the tracer for cones that start at `eye_m`.
    pub fn at(&self, eye_m: Vec3) -> Cow<'_, ConeTracer> {
        match &self.tracers {
            Tracers::Shared(tracer) => Cow::Borrowed(tracer),
            Tracers::PerViewpoint(light) => Cow::Owned(tracer(&light.seen_from(eye_m))),
        }
    }
}

fn tracer(light: &LightOctree) -> ConeTracer {
    ConeTracer::new(light, Settings::default()).expect("default settings are valid, and there are no lobes")
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use lo_geometry::Cube;
    use lo_octree::{Provenance, RadiancePoint};

    use super::*;

    #[test]
    fn lobes_depend_on_the_viewpoint() {
        let point =
            RadiancePoint { position_m: Vec3::splat(0.1), radiance: [1.0; 3], provenance: Provenance::Observed };
        let cube = Cube::centred(Vec3::ZERO, 4.0);
        let mut light = LightOctree::from_points(&[point], cube, 4, 2).unwrap().0;
        let seen_from = |light: &LightOctree, eye: Vec3| {
            let renderer = OctreeRenderer::new(light);
            renderer.at(eye).panorama(eye, 64, 32).radiance.pixels().iter().map(|p| p[0]).fold(0.0, f32::max)
        };
        let (left, right) = (Vec3::new(-0.6, 0.1, 0.1), Vec3::new(0.8, 0.1, 0.1));
        assert!((seen_from(&light, left) / seen_from(&light, right) - 1.0).abs() < 0.2);
        light.lobes = Some(light.rgba.iter().map(|rows| vec![[2.0, 0.0, 0.0]; rows.len()]).collect());
        assert!(matches!(ConeTracer::new(&light, Settings::default()), Err(crate::TracerError::Lobes)));
        assert!(seen_from(&light, right) > 10.0 * seen_from(&light, left));
    }
}
