//! Conversion between equirectangular maps and pinhole views.

use std::f32::consts::TAU;

use lo_geometry::{Camera, Mat3, direction_from_uv};
use rayon::prelude::*;

use crate::{Image, RadianceImage, sample_equirectangular};

/// Largest number of samples along a pixel's side, for a source finer than the result.
const MAX_SAMPLES: usize = 8;

/// Returns the number of samples along the side of a new pixel that is `ratio` source pixels wide.
pub(crate) fn samples_per_side(ratio: f32) -> usize {
    // the comparison also maps NaN to 1
    if ratio > 1.0 { (ratio.ceil() as usize).min(MAX_SAMPLES) } else { 1 }
}

/// Renders an image in parallel; each pixel is the mean of `samples`² lookups at `(x, y)` in pixels.
pub(crate) fn render<const N: usize>(
    width: usize,
    height: usize,
    samples: usize,
    lookup: impl Fn(f32, f32) -> [f32; N] + Sync,
) -> Image<[f32; N]> {
    let step = 1.0 / samples as f32;
    let weight = step * step;
    let pixel = |index: usize| {
        let (x, y) = ((index % width) as f32, (index / width) as f32);
        let mut mean = [0.0f32; N];
        for (i, j) in (0..samples).flat_map(|j| (0..samples).map(move |i| (i, j))) {
            let value = lookup(x + (i as f32 + 0.5) * step, y + (j as f32 + 0.5) * step);
            for c in 0..N {
                mean[c] += weight * value[c];
            }
        }
        mean
    };
    Image::new(width, height, (0..width * height).into_par_iter().map(pixel).collect())
}

/// Returns the rotation `world_from_camera` of a view with the given angles in radians.
///
/// Applies yaw to the right (from −Z towards +X), then pitch upwards, then roll clockwise as seen by the viewer.
pub fn view_rotation(yaw_rad: f32, pitch_rad: f32, roll_rad: f32) -> Mat3 {
    Mat3::from_rotation_y(-yaw_rad) * Mat3::from_rotation_x(pitch_rad) * Mat3::from_rotation_z(-roll_rad)
}

/// Renders the view of a rotated camera from an equirectangular map; averages where the map is finer.
pub fn perspective_from_equirectangular(
    map: &RadianceImage,
    camera: &Camera,
    world_from_camera: Mat3,
) -> RadianceImage {
    let samples = samples_per_side(camera.pixel_angle_rad() * map.width() as f32 / TAU);
    render(camera.width as usize, camera.height as usize, samples, |u, v| {
        sample_equirectangular(map, world_from_camera * camera.direction(f64::from(u), f64::from(v)))
    })
}

/// Projects a view onto an equirectangular map of `width` × `height`; pixels outside the view are 0.
///
/// Radiance is premultiplied by the fourth component, the share of the pixel that the view covers.
///
/// # Panics
/// If the image does not have the camera's size.
pub fn equirectangular_from_perspective(
    image: &RadianceImage,
    camera: &Camera,
    world_from_camera: Mat3,
    width: usize,
    height: usize,
) -> Image<[f32; 4]> {
    let size = (image.width() as u32, image.height() as u32);
    assert_eq!(size, (camera.width, camera.height), "the image must have the camera's size");
    let camera_from_world = world_from_camera.transpose();
    // a view's smallest pixels are at its corners; twice the density of the centre covers views of up to 90°
    let samples = samples_per_side(2.0 * TAU / width as f32 / camera.pixel_angle_rad());
    render(width, height, samples, |x, y| {
        let direction = direction_from_uv((x / width as f32, y / height as f32).into());
        let inside = camera.project(camera_from_world * direction).filter(|&(u, v, _)| camera.contains(u, v));
        inside.map_or([0.0; 4], |(u, v, _)| {
            let [r, g, b] = sample_clamped(image, u as f32, v as f32);
            [r, g, b, 1.0]
        })
    })
}

/// Samples bilinearly at `(x, y)` in pixels (centres at +0.5); clamps to the border.
pub fn sample_clamped(image: &RadianceImage, x: f32, y: f32) -> [f32; 3] {
    let axis = |position: f32, count: usize| {
        let position = (position - 0.5).clamp(0.0, (count - 1) as f32);
        let first = position as usize;
        (first, (first + 1).min(count - 1), position - first as f32)
    };
    let (x0, x1, fx) = axis(x, image.width());
    let (y0, y1, fy) = axis(y, image.height());
    let mix = |a: [f32; 3], b: [f32; 3], t: f32| [0, 1, 2].map(|c| a[c] + (b[c] - a[c]) * t);
    mix(mix(image[(x0, y0)], image[(x1, y0)], fx), mix(image[(x0, y1)], image[(x1, y1)], fx), fy)
}

/// A map of directions as colours, to test projections.
#[cfg(test)]
pub(crate) fn direction_map(width: usize, height: usize) -> RadianceImage {
    RadianceImage::from_fn(width, height, |x, y| lo_geometry::pixel_direction(x, y, width, height).to_array())
}

/// Largest angle, in radians, between the directions stored in pixels and the expected ones.
#[cfg(test)]
pub(crate) fn worst_angle(image: &RadianceImage, expected: impl Fn(usize, usize) -> lo_geometry::Vec3) -> f32 {
    use lo_geometry::Vec3;
    let angle = |index: usize| {
        let (x, y) = (index % image.width(), index / image.width());
        Vec3::from_array(image.pixels()[index]).normalize().angle_between(expected(x, y))
    };
    (0..image.pixels().len()).map(angle).fold(0.0, f32::max)
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use lo_geometry::{Vec3, pixel_direction};

    #[test]
    fn views_turn_the_way_their_angles_say() {
        let quarter = TAU / 4.0;
        let forward = |yaw, pitch, roll| view_rotation(yaw, pitch, roll) * Vec3::NEG_Z;
        assert!((forward(0.0, 0.0, 0.3) - Vec3::NEG_Z).length() < 1e-6);
        assert!((forward(quarter, 0.0, 0.0) - Vec3::X).length() < 1e-6);
        assert!((forward(0.3, quarter, 0.0) - Vec3::Y).length() < 1e-6);
        // clockwise: the camera's up leans to the right
        assert!((view_rotation(0.0, 0.0, quarter) * Vec3::Y - Vec3::X).length() < 1e-6);
    }

    #[test]
    fn a_view_of_the_direction_map_shows_its_own_rays() {
        let map = direction_map(512, 256);
        let camera = Camera::from_hfov_deg(80.0, 64, 48).unwrap();
        for rotation in [view_rotation(0.0, 0.0, 0.0), view_rotation(3.1, 0.4, -0.7), view_rotation(1.0, 1.4, 0.2)] {
            let view = perspective_from_equirectangular(&map, &camera, rotation);
            let worst = worst_angle(&view, |x, y| rotation * camera.direction(x as f64 + 0.5, y as f64 + 0.5));
            // the mean over a pixel bends directions by less than a tenth of the map's pixel (0.012)
            assert!(worst < 1.5e-3, "{worst}");
        }
    }

    #[test]
    fn a_view_goes_back_to_where_it_came_from() {
        let camera = Camera::from_hfov_deg(70.0, 300, 200).unwrap();
        let rotation = view_rotation(3.0, -0.3, 0.2);
        let rays = RadianceImage::from_fn(300, 200, |x, y| {
            (rotation * camera.direction(x as f64 + 0.5, y as f64 + 0.5)).to_array()
        });
        let patch = equirectangular_from_perspective(&rays, &camera, rotation, 256, 128);
        let mut solid_angle = 0.0;
        for (index, &[r, g, b, coverage]) in patch.pixels().iter().enumerate() {
            let (x, y) = (index % 256, index / 256);
            solid_angle += f64::from(coverage * lo_geometry::pixel_solid_angle_sr(y, 256, 128));
            if coverage > 0.999 {
                let angle = Vec3::new(r, g, b).angle_between(pixel_direction(x, y, 256, 128));
                assert!(angle < 2e-3, "{angle}");
            } else {
                assert!(coverage > 0.0 || [r, g, b] == [0.0; 3]);
            }
        }
        // solid angle of a centred rectangle a × b at distance 1: 4 asin(ab / √((1 + a²)(1 + b²)))
        let (a, b) = (150.0 / camera.fx, 100.0 / camera.fy);
        let expected = 4.0 * (a * b / ((1.0 + a * a) * (1.0 + b * b)).sqrt()).asin();
        assert!((solid_angle / expected - 1.0).abs() < 5e-3, "{solid_angle} {expected}");
    }
}
