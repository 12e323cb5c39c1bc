//! Baselines: panoramas from the photo alone, without a model of the room.

use lo_dataset::Sample;
use lo_geometry::{Vec2, Vec3, direction_from_uv, pixel_direction};
use lo_imaging::{RadianceImage, linear_from_srgb8, luminance, resize_equirectangular};
use lo_metrics::solid_angles_sr;

use crate::profile::{Profile, mean_colour};

/// Size of the baselines' panoramas.
pub(crate) const MAP: [usize; 2] = [256, 128];

/// Returns the photo's mean colour in all directions.
pub(crate) fn mean_colour_map(sample: &Sample) -> RadianceImage {
    let [width, height] = MAP;
    RadianceImage::new(width, height, vec![mean_colour(sample); width * height])
}

/// Returns the profile times the photo's mean colour, about the true up vector if known, else the photo's.
pub(crate) fn profile_map(sample: &Sample, profile: &Profile) -> RadianceImage {
    let [width, height] = MAP;
    let (mean, up) = (mean_colour(sample), sample.up.unwrap_or(Vec3::Y));
    RadianceImage::from_fn(width, height, |x, y| {
        let factor = profile.at(pixel_direction(x, y, width, height), up);
        mean.map(|v| v * factor)
    })
}

/// Returns the linear profile times the photo's mean luminance, with half the chroma of its mean colour.
///
/// Uses the up vector of [`profile_map`]. `None` if the profile has no linear factors.
pub(crate) fn fixed_shape_map(sample: &Sample, profile: &Profile) -> Option<RadianceImage> {
    let [width, height] = MAP;
    let (mean, up) = (mean_colour(sample), sample.up.unwrap_or(Vec3::Y));
    let colour = half_chroma(mean).map(|v| v * luminance(mean));
    profile.linear_at(up, up)?;
    Some(RadianceImage::from_fn(width, height, |x, y| {
        let factor = profile.linear_at(pixel_direction(x, y, width, height), up).unwrap_or(0.0);
        colour.map(|v| v * factor)
    }))
}

/// Lower limit of radiance, and of a channel over luminance, before roots and cubes.
const MIN_VALUE: f32 = 1e-6;

/// Halves the chroma of a colour in log space, at luminance 1: square roots of the channels over luminance.
fn half_chroma(rgb: [f32; 3]) -> [f32; 3] {
    let whole = luminance(rgb).max(f32::MIN_POSITIVE);
    let root = rgb.map(|v| (v / whole).max(MIN_VALUE).sqrt());
    root.map(|v| v / luminance(root))
}

/// Cubes the luminance of a panorama at constant ∫ L dω, and halves its chroma.
pub(crate) fn cubed(panorama: &RadianceImage) -> RadianceImage {
    let light = |rgb: &[f32; 3]| f64::from(luminance(rgb.map(|v| v.max(MIN_VALUE))));
    let angles = solid_angles_sr(panorama.width(), panorama.height());
    let power = |exponent: i32| -> f64 {
        panorama.pixels().iter().zip(&angles).map(|(rgb, &angle)| light(rgb).powi(exponent) * f64::from(angle)).sum()
    };
    let gain = power(1) / power(3);
    panorama.map(|rgb| {
        let cube = (gain * light(rgb).powi(3)) as f32;
        half_chroma(rgb.map(|v| v.max(MIN_VALUE))).map(|v| v * cube)
    })
}

/// Fills the sphere by mirroring the photo repeatedly at its edges, in angles.
pub(crate) fn mirrored_map(sample: &Sample) -> RadianceImage {
    let camera = &sample.camera;
    let half = [
        camera.cx.min(f64::from(camera.width) - camera.cx) / camera.fx,
        camera.cy.min(f64::from(camera.height) - camera.cy) / camera.fy,
    ]
    .map(|tangent| tangent.atan() as f32);
    let linear = sample.photo.map(|rgb| rgb.map(linear_from_srgb8));
    // Supersampled by 2 × 2.
    let [width, height] = MAP.map(|size| 2 * size);
    let map = RadianceImage::from_fn(width, height, |x, y| {
        let uv = Vec2::new((x as f32 + 0.5) / width as f32, (y as f32 + 0.5) / height as f32);
        let longitude = (uv.x - 0.5) * std::f32::consts::TAU;
        let latitude = (0.5 - uv.y) * std::f32::consts::PI;
        let (along, up) = (folded(longitude, half[0]), folded(latitude, half[1]));
        let inside = Vec2::new(along / std::f32::consts::TAU + 0.5, 0.5 - up / std::f32::consts::PI);
        let direct = camera.project(direction_from_uv(uv)).filter(|(u, v, _)| {
            (0.0..f64::from(camera.width)).contains(u) && (0.0..f64::from(camera.height)).contains(v)
        });
        let (u, v, _) = direct.or_else(|| camera.project(direction_from_uv(inside))).unwrap_or((0.0, 0.0, 1.0));
        let at = |t: f64, size: usize| (t.max(0.0) as usize).min(size - 1);
        linear[(at(u, linear.width()), at(v, linear.height()))]
    });
    resize_equirectangular(&map, MAP[0], MAP[1])
}

/// Folds an angle into ± `half` (a triangle wave).
fn folded(angle: f32, half: f32) -> f32 {
    let turned = (angle + half).rem_euclid(4.0 * half);
    if turned <= 2.0 * half { turned - half } else { 3.0 * half - turned }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::{ProfileBuilder, testing};
    use lo_imaging::Image;

    #[test]
    fn the_photo_is_where_it_was_and_its_mirror_beside_it() {
        let mut sample = testing::sample();
        // Red increases to the right, green downwards.
        sample.photo = Image::from_fn(96, 64, |x, y| [(2 * x) as u8, (3 * y) as u8, 0]);
        let map = mirrored_map(&sample);
        let camera = sample.camera;
        for (x, y) in [(20, 30), (48, 32), (80, 50)] {
            let uv = lo_geometry::uv_from_direction(camera.direction(x as f64 + 0.5, y as f64 + 0.5));
            let got = map[((uv.x * 256.0) as usize, (uv.y * 128.0) as usize)];
            let expected = sample.photo[(x, y)].map(linear_from_srgb8);
            assert!((0..3).all(|c| (got[c] - expected[c]).abs() < 0.03), "{x}, {y}: {got:?} {expected:?}");
        }
        // The right edge at 32.5° is the mirror axis.
        let (inside, outside) = (column_at(&map, 26.0), column_at(&map, 39.0));
        assert!((inside[0] - outside[0]).abs() < 0.03, "{inside:?} {outside:?}");
    }

    fn column_at(map: &RadianceImage, degrees: f32) -> [f32; 3] {
        map[(((0.5 + degrees / 360.0) * 256.0) as usize, 64)]
    }

    #[test]
    fn a_cube_keeps_the_integral_and_half_of_the_chroma() {
        let (dim, bright) = ([0.4, 0.1, 0.1], [1.6, 0.4, 0.4]);
        let map = RadianceImage::from_fn(64, 32, |x, _| if x < 32 { dim } else { bright });
        let got = cubed(&map);
        // Relative luminances 1 and 4 become 1 and 64, times 5 / 65.
        let expected = [5.0 / 65.0, 64.0 * 5.0 / 65.0].map(|v| v * luminance(dim));
        for (x, expected) in [(3, expected[0]), (40, expected[1])] {
            let rgb = got[(x, 9)];
            assert!((luminance(rgb) / expected - 1.0).abs() < 1e-4, "{rgb:?} {expected}");
            assert!((rgb[0] / rgb[1] - 2.0).abs() < 1e-4, "{rgb:?}");
        }
    }

    #[test]
    fn a_fixed_shape_is_as_bright_as_the_photo_and_half_as_colourful() {
        let mut sample = testing::box_room();
        let mut builder = ProfileBuilder::default();
        builder.add(&sample);
        let profile = builder.finish("one room").unwrap();
        sample.photo = Image::new(96, 64, vec![[200, 200, 100]; 96 * 64]);
        let (map, mean) = (fixed_shape_map(&sample, &profile).unwrap(), mean_colour(&sample));
        let angles = solid_angles_sr(map.width(), map.height());
        let power: f32 = map.pixels().iter().zip(&angles).map(|(&rgb, angle)| luminance(rgb) * angle).sum();
        assert!((power / (4.0 * std::f32::consts::PI * luminance(mean)) - 1.0).abs() < 0.01, "{power} {mean:?}");
        let [r, _, b] = map[(7, 7)];
        assert!((r / b - (mean[0] / mean[2]).sqrt()).abs() < 1e-4);
    }

    #[test]
    fn folding_is_a_triangle_wave() {
        for (angle, expected) in
            [(0.0, 0.0), (0.4, 0.4), (0.6, 0.4), (1.0, 0.0), (1.4, -0.4), (1.6, -0.4), (-0.6, -0.4)]
        {
            assert!((folded(angle, 0.5) - expected).abs() < 1e-6, "{angle}");
        }
    }

    #[test]
    fn the_mean_is_of_linear_light() {
        let mut sample = testing::sample();
        sample.photo = Image::from_fn(96, 64, |x, _| [if x < 48 { 0 } else { 255 }, 128, 0]);
        let [r, g, b] = mean_colour(&sample);
        assert!((r - 0.5).abs() < 1e-6 && (g - 0.215_860_5).abs() < 1e-6 && b == 0.0);
        assert_eq!(mean_colour_map(&sample)[(3, 100)], [r, g, b]);
    }
}
