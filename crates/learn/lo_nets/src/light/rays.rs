use std::sync::Arc;

use lo_cone::Cone;
use lo_geometry::{Camera, Vec3};
use lo_imaging::{DepthMap, Image};
use lo_random::{RngExt, Stream};

/// Cones with true radiance and distance.
#[derive(Clone, Debug)]
pub struct Rays {
    /// Cones.
    pub cones: Arc<[Cone]>,
    /// True linear RGB radiance of each cone.
    pub radiance: Vec<[f32; 3]>,
    /// True distance of each cone in metres; 0 where unknown.
    pub distance_m: Vec<f32>,
}

impl Rays {
    /// Draws `count` pixels of a linear RGB photo taken from the origin, and keeps those that are not clipped (all
    /// channels below `white`) and have a depth reading (metres along the optical axis, same size).
    pub fn of_photo(
        photo: &Image<[f32; 3]>,
        depth_m: &DepthMap,
        camera: &Camera,
        white: f32,
        count: usize,
        stream: &mut Stream,
    ) -> Self {
        let camera = camera.resized(photo.width() as u32, photo.height() as u32);
        let tan_half_angle = (0.5 * camera.pixel_angle_rad()).tan();
        Self::from_iter((0..count).filter_map(|_| {
            let at = (stream.random_range(0..photo.width()), stream.random_range(0..photo.height()));
            let point = camera.unproject(at.0 as f64 + 0.5, at.1 as f64 + 0.5, f64::from(depth_m[at]));
            let clear = photo[at].iter().all(|&c| c < white) && depth_m[at].is_finite() && depth_m[at] > 0.0;
            let cone = Cone { origin: Vec3::ZERO, direction: point.normalize_or(Vec3::NEG_Z), tan_half_angle };
            clear.then(|| (cone, photo[at], point.length()))
        }))
    }

    /// Returns the number of rays.
    pub fn len(&self) -> usize {
        self.cones.len()
    }

    /// Reports whether there are no rays.
    pub fn is_empty(&self) -> bool {
        self.cones.is_empty()
    }
}

impl FromIterator<(Cone, [f32; 3], f32)> for Rays {
    fn from_iter<I: IntoIterator<Item = (Cone, [f32; 3], f32)>>(rays: I) -> Self {
        let (mut cones, mut radiance, mut distance_m) = (Vec::new(), Vec::new(), Vec::new());
        for (cone, rgb, distance) in rays {
            cones.push(cone);
            radiance.push(rgb);
            distance_m.push(distance);
        }
        Self { cones: cones.into(), radiance, distance_m }
    }
}
