//! Lookup, rotation and resizing of equirectangular maps (`lo_geometry` defines the convention).

use lo_geometry::{Orientation, Quat, Vec2, Vec3, direction_from_uv, uv_from_direction};
use rayon::prelude::*;

use crate::color::luminance;
use crate::resize::{weighted, weights};
use crate::{DepthMap, Image, RadianceImage};

/// Returns the mean luminance of an equirectangular panorama over the sphere. Each pixel counts with 0 to 10⁹.
pub fn mean_luminance(map: &RadianceImage) -> f64 {
    let (width, height) = (map.width(), map.height());
    let row = |y: usize| -> f64 {
        let solid_angle_sr = f64::from(lo_geometry::pixel_solid_angle_sr(y, width, height));
        let finite = |rgb: &[f32; 3]| f64::from(luminance(*rgb)).max(0.0).clamp(0.0, 1e9);
        map.pixels()[y * width..(y + 1) * width].iter().map(finite).sum::<f64>() * solid_angle_sr
    };
    (0..height).map(row).sum::<f64>() / (4.0 * std::f64::consts::PI)
}

/// Returns the radiance from a direction (of any length).
///
/// Interpolates bilinearly between pixel centres, across the seam, and over the poles to the opposite meridian.
///
/// # Panics
/// If the map has no pixels.
pub fn sample_equirectangular(map: &RadianceImage, direction: Vec3) -> [f32; 3] {
    let (width, height) = (map.width(), map.height());
    let uv = uv_from_direction(direction);
    let (x, y) = (uv.x * width as f32 - 0.5, uv.y * height as f32 - 0.5);
    let (x0, y0) = (x.floor(), y.floor());
    let (fx, fy) = (x - x0, y - y0);
    let (x0, y0) = (x0 as i64, y0 as i64);
    let pixel = |dx: i64, dy: i64| {
        let (mut column, mut row) = (x0 + dx, y0 + dy);
        if row < 0 || row >= height as i64 {
            row = row.clamp(0, height as i64 - 1);
            column += width as i64 / 2;
        }
        map[(column.rem_euclid(width as i64) as usize, row as usize)]
    };
    let mix = |a: [f32; 3], b: [f32; 3], t: f32| [0, 1, 2].map(|c| a[c] + (b[c] - a[c]) * t);
    mix(mix(pixel(0, 0), pixel(1, 0), fx), mix(pixel(0, 1), pixel(1, 1), fx), fy)
}

/// Rotates the content of a map: direction d moves to `rotation` · d.
///
/// The result has `width` × `height` pixels, each the mean of 2 × 2 lookups. A source twice as fine avoids a loss of
/// detail.
///
/// # Panics
/// If the map has no pixels.
pub fn rotate_equirectangular(map: &RadianceImage, rotation: Quat, width: usize, height: usize) -> RadianceImage {
    let back = rotation.inverse();
    let pixel = |index: usize| {
        let (x, y) = ((index % width) as f32, (index / width) as f32);
        let mut sum = Vec3::ZERO;
        for (dx, dy) in [(0.25, 0.25), (0.75, 0.25), (0.25, 0.75), (0.75, 0.75)] {
            let uv = Vec2::new((x + dx) / width as f32, (y + dy) / height as f32);
            sum += Vec3::from(sample_equirectangular(map, back * direction_from_uv(uv)));
        }
        (sum / 4.0).to_array()
    };
    Image::new(width, height, (0..width * height).into_par_iter().map(pixel).collect())
}

/// Like [`rotate_equirectangular`], for depth: takes the nearest pixel and never mixes surfaces.
///
/// # Panics
/// If the map has no pixels.
pub fn rotate_equirectangular_nearest(map: &DepthMap, rotation: Quat, width: usize, height: usize) -> DepthMap {
    let back = rotation.inverse();
    Image::from_fn(width, height, |x, y| {
        let uv = Vec2::new((x as f32 + 0.5) / width as f32, (y as f32 + 0.5) / height as f32);
        let uv = uv_from_direction(back * direction_from_uv(uv));
        let nearest = |at: f32, count: usize| ((at * count as f32) as usize).min(count - 1);
        map[(nearest(uv.x, map.width()), nearest(uv.y, map.height()))]
    })
}

/// Rotates a map's content from one program's orientation to another's.
///
/// Exact (whole pixels move) if the width is a multiple of 4, or for a half turn of an even width. Otherwise
/// neighbouring columns are averaged.
pub fn reorient(map: &RadianceImage, from: Orientation, to: Orientation) -> RadianceImage {
    turn(map, from, to, |a, b| [0, 1, 2].map(|c| 0.5 * (a[c] + b[c])))
}

/// Like [`reorient`], for depth: never averages columns, but rounds the shift to whole pixels.
pub fn reorient_depth(map: &DepthMap, from: Orientation, to: Orientation) -> DepthMap {
    turn(map, from, to, |a, _| *a)
}

/// Moves the content left by quarters of the width; `between` gives the pixel halfway between two columns.
fn turn<T: Copy>(map: &Image<T>, from: Orientation, to: Orientation, between: impl Fn(&T, &T) -> T) -> Image<T> {
    let (width, height) = (map.width(), map.height());
    let quarters = (to.quarter_turns() + 4 - from.quarter_turns()) as usize % 4;
    // the shift is a whole number of half pixels for even widths; for odd ones a quarter pixel is dropped
    let half_pixels = quarters * width / 2;
    let (shift, halfway) = (half_pixels / 2, half_pixels % 2 == 1);
    Image::from_fn(width, height, |x, y| {
        let pixel = &map[((x + shift) % width, y)];
        if halfway { between(pixel, &map[((x + shift + 1) % width, y)]) } else { *pixel }
    })
}

/// Resizes an equirectangular map and preserves the power ∫ L dω.
///
/// Each new pixel is the mean over the area it covers, weighted by solid angle. An enlarged axis is interpolated
/// linearly.
///
/// # Panics
/// If either size has no pixels.
pub fn resize_equirectangular(map: &RadianceImage, width: usize, height: usize) -> RadianceImage {
    assert!(!map.pixels().is_empty() && width > 0 && height > 0, "an image without pixels cannot be resized");
    // a row's share of the sphere is the difference of the sines of its edges' latitudes
    let sine = |edge: f64| -((0.5 - edge) * std::f64::consts::PI).sin();
    let rows = weights(map.height(), height, sine, |row, count| row.clamp(0, count - 1));
    let columns = weights(map.width(), width, |edge| edge, i64::rem_euclid);
    weighted(map, &columns, &rows)
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use lo_geometry::{pixel_direction, pixel_solid_angle_sr};
    use proptest::prelude::*;

    fn noise(width: usize, height: usize) -> RadianceImage {
        let mut state = 1u32;
        let mut next = || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (state >> 8) as f32 / (1 << 24) as f32
        };
        RadianceImage::from_fn(width, height, |_, _| [next() * 10.0, next(), next().powi(8) * 1000.0])
    }

    fn power(map: &RadianceImage) -> [f64; 3] {
        let mut sum = [0.0; 3];
        for (index, pixel) in map.pixels().iter().enumerate() {
            let solid_angle = f64::from(pixel_solid_angle_sr(index / map.width(), map.width(), map.height()));
            for c in 0..3 {
                sum[c] += solid_angle * f64::from(pixel[c]);
            }
        }
        sum
    }

    #[test]
    fn turned_maps_show_what_they_showed_elsewhere() {
        // Smooth radiance by direction, 2 + a linear function: the rotated map has a closed form.
        let axis = Vec3::new(0.5, -0.3, 0.8);
        let light = |d: Vec3| 2.0 + axis.dot(d);
        let map = RadianceImage::from_fn(256, 128, |x, y| [light(pixel_direction(x, y, 256, 128)); 3]);
        let rotation = Quat::from_axis_angle(Vec3::new(1.0, 0.2, -0.4).normalize(), 0.4);
        let turned = rotate_equirectangular(&map, rotation, 128, 64);
        let depth = rotate_equirectangular_nearest(&map.map(|p| p[0]), rotation, 128, 64);
        for y in 0..64 {
            for x in 0..128 {
                let expected = light(rotation.inverse() * pixel_direction(x, y, 128, 64));
                assert!((turned[(x, y)][1] - expected).abs() < 2e-3, "{x} {y}: {} for {expected}", turned[(x, y)][1]);
                // At most half a pixel of the map off.
                assert!((depth[(x, y)] - expected).abs() < 0.02, "{x} {y}: {} for {expected}", depth[(x, y)]);
            }
        }
        let (before, after) =
            (power(&noise(256, 128)), power(&rotate_equirectangular(&noise(256, 128), rotation, 128, 64)));
        for c in 0..2 {
            assert!((after[c] / before[c] - 1.0).abs() < 0.01, "{before:?} {after:?}");
        }
    }

    #[test]
    fn shrinking_keeps_power_and_constants() {
        let map = noise(256, 128);
        for (width, height) in [(128, 64), (64, 32), (100, 50), (255, 127), (3, 2), (1, 1), (256, 128)] {
            let small = resize_equirectangular(&map, width, height);
            for (a, b) in power(&small).into_iter().zip(power(&map)) {
                assert!((a / b - 1.0).abs() < 1e-5, "{width} × {height}: {a} {b}");
            }
        }
        assert_eq!(resize_equirectangular(&map, 256, 128), map);
        let constant = RadianceImage::from_fn(50, 25, |_, _| [0.3, 2.0, 7.0]);
        for (width, height) in [(13, 6), (80, 40), (200, 10)] {
            for pixel in resize_equirectangular(&constant, width, height).pixels() {
                assert!(pixel.iter().zip([0.3, 2.0, 7.0]).all(|(a, b)| (a / b - 1.0).abs() < 1e-6));
            }
        }
    }

    #[test]
    fn a_row_counts_by_its_solid_angle() {
        // two rows into one: the pole's row covers 1 − sin 45°, the other sin 45°, of the hemisphere
        let map = RadianceImage::from_fn(4, 4, |_, y| [if y == 0 { 1.0 } else { 0.0 }; 3]);
        let got = resize_equirectangular(&map, 2, 2)[(0, 0)][0];
        assert!((f64::from(got) - (1.0 - 0.5f64.sqrt())).abs() < 1e-6, "{got}");
    }

    #[test]
    fn growing_interpolates_across_the_seam() {
        let map = RadianceImage::from_fn(4, 2, |x, _| [x as f32; 3]);
        let large = resize_equirectangular(&map, 8, 4);
        let row: Vec<f32> = (0..8).map(|x| large[(x, 1)][0]).collect();
        assert_eq!(row, [0.75, 0.25, 0.75, 1.25, 1.75, 2.25, 2.75, 2.25]);
    }

    #[test]
    fn orientation_presets_move_whole_pixels_and_come_back() {
        for (width, height) in [(16, 8), (64, 3)] {
            let map = noise(width, height);
            for from in Orientation::ALL {
                for to in Orientation::ALL {
                    let turned = reorient(&map, from, to);
                    assert_eq!(reorient(&turned, to, from), map, "{from:?} {to:?}");
                }
                // a world direction's light is at the preset's rotation of it in the preset's map
                let turned = reorient(&map, Orientation::Lightoctree, from);
                for (x, y) in (0..width).flat_map(|x| (0..height).map(move |y| (x, y))) {
                    let uv = uv_from_direction(from.map_from_world() * pixel_direction(x, y, width, height));
                    let (u, v) = ((uv.x * width as f32) as usize % width, (uv.y * height as f32) as usize);
                    assert_eq!(turned[(u, v)], map[(x, y)], "{from:?}");
                }
            }
        }
        let depth = DepthMap::from_fn(8, 4, |x, y| (x + 10 * y) as f32);
        assert_eq!(reorient_depth(&depth, Orientation::Lightoctree, Orientation::Openexr)[(0, 1)], 14.0);
    }

    #[test]
    fn widths_that_are_no_multiple_of_four_are_mixed() {
        let map = RadianceImage::from_fn(6, 1, |x, _| [x as f32; 3]);
        let turned = reorient(&map, Orientation::Lightoctree, Orientation::Threejs);
        let row: Vec<f32> = turned.pixels().iter().map(|p| p[0]).collect();
        assert_eq!(row, [1.5, 2.5, 3.5, 4.5, 2.5, 0.5]);
    }

    #[test]
    fn the_pole_is_the_mean_of_the_pixels_around_it() {
        let map = noise(32, 16);
        // atan2(0, −0) puts straight up on the seam: two columns there, and two opposite
        let expected = [31, 0, 15, 16].iter().map(|&x| map[(x, 0)][0]).sum::<f32>() / 4.0;
        assert!((sample_equirectangular(&map, Vec3::Y)[0] - expected).abs() < 1e-3);
        let below = sample_equirectangular(&map, Vec3::new(1e-4, -1.0, 0.0));
        let expected = [23, 24, 7, 8].iter().map(|&x| map[(x, 15)][0]).sum::<f32>() / 4.0;
        assert!((below[0] - expected).abs() < 0.02, "{below:?} {expected}");
    }

    proptest! {
        #[test]
        fn samples_agree_with_pixels(x in 0usize..32, y in 0usize..16) {
            let map = noise(32, 16);
            let got = sample_equirectangular(&map, pixel_direction(x, y, 32, 16));
            for c in 0..3 {
                // f32 angles move the lookup by up to 1e-5 of a pixel between values of up to 1000
                prop_assert!((got[c] - map[(x, y)][c]).abs() < 0.05 + 1e-4 * map[(x, y)][c]);
            }
        }
    }

    #[test]
    fn the_mean_is_over_the_sphere() {
        // the upper half has 3, of which luminance is linear
        let map = RadianceImage::from_fn(64, 32, |_, y| if y < 16 { [3.0; 3] } else { [1.0; 3] });
        assert!((mean_luminance(&map) - 2.0).abs() < 1e-5);
        let odd = RadianceImage::new(2, 1, vec![[f32::NEG_INFINITY; 3], [2.0; 3]]);
        assert!((mean_luminance(&odd) - 1.0).abs() < 1e-5);
    }
}
