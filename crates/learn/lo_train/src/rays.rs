use lo_cone::Cone;
use lo_dataset::NovelView;
use lo_nets::light::Rays;
use lo_random::{RngExt, Stream};

/// Draws `count` rays of panorama pixels, uniformly over the panoramas and over solid angle.
pub fn sample_panorama_rays(views: &[NovelView], count: usize, stream: &mut Stream) -> Rays {
    if views.is_empty() {
        return Rays::from_iter([]);
    }
    Rays::from_iter((0..count).map(|_| {
        let view = &views[stream.random_range(0..views.len())];
        let (width, height) = (view.radiance.width(), view.radiance.height());
        let sine: f32 = stream.random_range(-1.0..1.0);
        let y = ((0.5 - sine.asin() / std::f32::consts::PI) * height as f32) as usize;
        panorama_ray(view, stream.random_range(0..width), y.min(height - 1))
    }))
}

/// Returns the rays of all pixels of a panorama, row by row.
pub fn panorama_rays(view: &NovelView) -> Rays {
    let (width, height) = (view.radiance.width(), view.radiance.height());
    Rays::from_iter((0..height).flat_map(|y| (0..width).map(move |x| panorama_ray(view, x, y))))
}

fn panorama_ray(view: &NovelView, x: usize, y: usize) -> (Cone, [f32; 3], f32) {
    let (width, height) = (view.radiance.width(), view.radiance.height());
    let cone = Cone {
        origin: view.position_m,
        direction: view.rotation * lo_geometry::pixel_direction(x, y, width, height),
        tan_half_angle: (std::f32::consts::PI / width as f32).tan(),
    };
    (cone, view.radiance[(x, y)], view.depth_m.as_ref().map_or(0.0, |depth| depth[(x, y)]))
}

#[cfg(test)]
mod tests {
    use lo_geometry::{Quat, Vec3};
    use lo_imaging::Image;

    use super::*;

    #[test]
    fn panorama_rays_cover_the_sphere_evenly() {
        let view = NovelView {
            position_m: Vec3::ONE,
            rotation: Quat::from_rotation_y(0.5),
            radiance: Image::from_fn(64, 32, |x, y| [x as f32, y as f32, 1.0]),
            depth_m: None,
        };
        let rays = sample_panorama_rays(std::slice::from_ref(&view), 20_000, &mut lo_random::stream(1, "test", 0));
        let mean = rays.cones.iter().map(|cone| cone.direction).sum::<Vec3>() / rays.len() as f32;
        assert!(mean.length() < 0.02, "{mean}");
        let up = rays.cones.iter().filter(|cone| cone.direction.y > 0.5).count();
        assert!((4700..5300).contains(&up), "{up} of 20,000 in a quarter of the sphere");
        let all = panorama_rays(&view);
        assert_eq!((all.len(), all.radiance[64 + 3]), (2048, [3.0, 1.0, 1.0]));
        let expected = view.rotation * lo_geometry::pixel_direction(3, 1, 64, 32);
        assert_eq!(all.cones[64 + 3].direction, expected);
    }
}
