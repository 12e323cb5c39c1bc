use std::sync::Arc;

use cone::Cone;
use dataset::NovelView;
use geometry::{Camera, Vec3};
use imaging::{DepthMap, Image};
use random::{RngExt, Stream};

/// Cones and what they ought to see.
#[derive(Clone, Debug)]
pub struct Rays {
    /// The cones.
    pub cones: Arc<[Cone]>,
    /// Linear RGB radiance that each sees.
    pub radiance: Vec<[f32; 3]>,
    /// Distance in metres that each sees; 0 where it is not known.
    pub distance_m: Vec<f32>,
}

impl Rays {
    /// `count` pixels of panoramas: each panorama is as likely as the others, every solid angle of it too.
    pub fn of_panoramas(views: &[NovelView], count: usize, stream: &mut Stream) -> Self {
        if views.is_empty() {
            return Self::from_iter([]);
        }
        Self::from_iter((0..count).map(|_| {
            let view = &views[stream.random_range(0..views.len())];
            let (width, height) = (view.radiance.width(), view.radiance.height());
            let sine: f32 = stream.random_range(-1.0..1.0);
            let y = ((0.5 - sine.asin() / std::f32::consts::PI) * height as f32) as usize;
            panorama_ray(view, stream.random_range(0..width), y.min(height - 1))
        }))
    }

    /// Every pixel of a panorama, row by row.
    pub fn of_panorama(view: &NovelView) -> Self {
        let (width, height) = (view.radiance.width(), view.radiance.height());
        Self::from_iter((0..height).flat_map(|y| (0..width).map(move |x| panorama_ray(view, x, y))))
    }

    /// `count` pixels of a photo (linear RGB) taken from the origin, where it is not clipped (all channels below `white`) and
    /// its depth map (metres along the optical axis, of the same size) has a reading.
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

    /// Number of rays.
    pub fn len(&self) -> usize {
        self.cones.len()
    }

    /// Whether there are none.
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

fn panorama_ray(view: &NovelView, x: usize, y: usize) -> (Cone, [f32; 3], f32) {
    let (width, height) = (view.radiance.width(), view.radiance.height());
    let cone = Cone {
        origin: view.position_m,
        direction: view.rotation * geometry::pixel_direction(x, y, width, height),
        tan_half_angle: (std::f32::consts::PI / width as f32).tan(),
    };
    (cone, view.radiance[(x, y)], view.depth_m.as_ref().map_or(0.0, |depth| depth[(x, y)]))
}

#[cfg(test)]
mod tests {
    use geometry::Quat;

    use super::*;

    #[test]
    fn panorama_rays_cover_the_sphere_evenly() {
        let view = NovelView {
            position_m: Vec3::ONE,
            rotation: Quat::from_rotation_y(0.5),
            radiance: Image::from_fn(64, 32, |x, y| [x as f32, y as f32, 1.0]),
            depth_m: None,
        };
        let rays = Rays::of_panoramas(std::slice::from_ref(&view), 20_000, &mut random::stream(1, "test", 0));
        let mean = rays.cones.iter().map(|cone| cone.direction).sum::<Vec3>() / rays.len() as f32;
        assert!(mean.length() < 0.02, "{mean}");
        let up = rays.cones.iter().filter(|cone| cone.direction.y > 0.5).count();
        assert!((4700..5300).contains(&up), "{up} of 20,000 in a quarter of the sphere");
        let all = Rays::of_panorama(&view);
        assert_eq!((all.len(), all.radiance[64 + 3]), (2048, [3.0, 1.0, 1.0]));
        let expected = view.rotation * geometry::pixel_direction(3, 1, 64, 32);
        assert_eq!(all.cones[64 + 3].direction, expected);
    }
}
