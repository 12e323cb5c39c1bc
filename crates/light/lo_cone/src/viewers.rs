use std::borrow::Cow;

use lo_geometry::Vec3;
use lo_octree::LightOctree;

use crate::{ConeTracer, Settings};

/// Tracers of one lighting octree for viewers at any place, with the usual settings: one for all of them, or, where nodes have
/// lobes and look different from everywhere, one made anew for each.
pub struct Viewers {
    light: Light,
}

enum Light {
    Same(Box<ConeTracer>),
    Directional(Box<LightOctree>),
}

impl Viewers {
    /// Prepares an octree; with lobes it is copied, without it is not needed after.
    pub fn new(light: &LightOctree) -> Self {
        let light = match light.lobes {
            Some(_) => Light::Directional(Box::new(light.clone())),
            None => Light::Same(Box::new(tracer(light))),
        };
        Self { light }
    }

    /// The tracer for cones that start at `eye_m`.
    pub fn at(&self, eye_m: Vec3) -> Cow<'_, ConeTracer> {
        match &self.light {
            Light::Same(tracer) => Cow::Borrowed(tracer),
            Light::Directional(light) => Cow::Owned(tracer(&light.seen_from(eye_m))),
        }
    }
}

fn tracer(light: &LightOctree) -> ConeTracer {
    ConeTracer::new(light, Settings::default()).expect("the usual settings are valid, and there are no lobes")
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use lo_geometry::Cube;
    use lo_octree::{Provenance, RadiancePoint};

    use super::*;

    #[test]
    fn a_lobe_shows_itself_by_the_viewers_place_and_light_without_lobes_does_not() {
        let point =
            RadiancePoint { position_m: Vec3::splat(0.1), radiance: [1.0; 3], provenance: Provenance::Observed };
        let cube = Cube::centred(Vec3::ZERO, 4.0);
        let mut light = LightOctree::from_points(&[point], cube, 4, 2).unwrap().0;
        let seen_from = |light: &LightOctree, eye: Vec3| {
            let viewers = Viewers::new(light);
            viewers.at(eye).panorama(eye, 64, 32).radiance.pixels().iter().map(|p| p[0]).fold(0.0, f32::max)
        };
        let (left, right) = (Vec3::new(-0.6, 0.1, 0.1), Vec3::new(0.8, 0.1, 0.1));
        assert!((seen_from(&light, left) / seen_from(&light, right) - 1.0).abs() < 0.2);
        light.lobes = Some(light.rgba.iter().map(|rows| vec![[2.0, 0.0, 0.0]; rows.len()]).collect());
        assert!(matches!(ConeTracer::new(&light, Settings::default()), Err(crate::TracerError::Lobes)));
        assert!(seen_from(&light, right) > 10.0 * seen_from(&light, left));
    }
}
