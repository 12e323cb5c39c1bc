//! Wear, repeating patterns and normal maps of surfaces.

use lo_geometry::smoothstep;
use lo_imaging::{Image, linear_from_srgb8, luminance, srgb8_from_linear};

use super::{Noise, Swatch, mix, scaled};

const SIZE: usize = 256;
/// Colour of old dirt and of water stains.
const DIRT: [f32; 3] = [0.11, 0.085, 0.055];

/// Repeating pattern of two or three colours with cells of size `cell_m`.
///
/// One of chequers, diamonds, rings, herringbone, stripes and mosaic.
pub(crate) fn pattern(seed: u64, colors: [[f32; 3]; 3], cell_m: f32) -> Swatch {
    let noise = Noise::new(seed);
    let kind = (noise.at(1, 1) * 6.0) as u32;
    let cells = 8i32;
    let size_m = [cells as f32 * cell_m; 2];
    Swatch::new([SIZE, SIZE], size_m, move |u, v| {
        let (x, y) = (u * cells as f32, v * cells as f32);
        let (i, j) = (x.floor() as i32, y.floor() as i32);
        let (a, b) = (x - x.floor() - 0.5, y - y.floor() - 0.5);
        let odd = (i + j).rem_euclid(2) == 0;
        let color = match kind {
            0 => colors[usize::from(odd)],
            1 => colors[if a.abs() + b.abs() < 0.25 { 2 } else { usize::from(a.abs() + b.abs() < 0.5) }],
            2 => {
                let r = a.hypot(b);
                colors[if r < 0.14 { 2 } else { usize::from(r > 0.3 && r < 0.44) }]
            }
            3 => {
                let along = if odd { a } else { b };
                colors[usize::from((along * 4.0).floor() as i32 % 2 == 0)]
            }
            4 => colors[[0, 1, 0, 2][j.rem_euclid(4) as usize]],
            _ => {
                let fine = [(x * 3.0).floor() as i32, (y * 3.0).floor() as i32];
                let place = noise.at(fine[0].rem_euclid(3 * cells), fine[1].rem_euclid(3 * cells));
                colors[if place < 0.5 {
                    0
                } else if place < 0.85 {
                    1
                } else {
                    2
                }]
            }
        };
        let grain = noise.derived(7).octaves(u, v, [96, 96], 2) - 0.5;
        scaled(color, 1.0 + 0.12 * grain)
    })
}

/// A plain colour with traces of brush and roller.
pub(crate) fn painted(seed: u64, color: [f32; 3]) -> Swatch {
    let noise = Noise::new(seed);
    Swatch::new([SIZE, SIZE], [1.6, 1.6], move |u, v| {
        let grain = noise.octaves(u, v, [110, 110], 2) - 0.5;
        scaled(color, 1.0 + 0.03 * grain)
    })
}

/// Adds stains, dirt and scratches to an image of sRGB codes; `amount` in [0, 1].
pub(crate) fn apply_wear(picture: &Image<[u8; 4]>, seed: u64, amount: f32) -> Image<[u8; 4]> {
    let noise = Noise::new(seed);
    let (width, height) = (picture.width(), picture.height());
    let stain_threshold = 0.72 - 0.18 * amount;
    // Scratches are short lines: start, direction, length.
    let scratches: Vec<[f32; 5]> = (0..(30.0 * amount) as i32)
        .map(|k| {
            let angle = std::f32::consts::TAU * noise.at(k, 52);
            [noise.at(k, 50), noise.at(k, 51), angle.cos(), angle.sin(), 0.03 + 0.12 * noise.at(k, 53)]
        })
        .collect();
    let mut worn = Image::from_fn(width, height, |x, y| {
        let (u, v) = ((x as f32 + 0.5) / width as f32, (y as f32 + 0.5) / height as f32);
        let [r, g, b, alpha] = picture[(x, y)];
        let clean = [r, g, b].map(linear_from_srgb8);
        let cloud = noise.octaves(u, v, [2, 2], 4);
        let stain = smoothstep(stain_threshold, stain_threshold + 0.12, cloud);
        // Dried water leaves a dark rim.
        let rim = smoothstep(0.03, 0.0, (cloud - stain_threshold).abs());
        let speck = smoothstep(0.9, 0.97, noise.derived(11).smooth(u, v, [70, 70]));
        let fading = 1.0 + 0.25 * amount * (noise.derived(12).octaves(u, v, [2, 2], 2) - 0.5);
        let dirt = amount * (0.3 * stain + 0.2 * rim * noise.derived(13).smooth(u, v, [5, 5]) + 0.5 * speck);
        let [r, g, b] =
            mix(scaled(clean, fading), DIRT, dirt.min(0.8)).map(|c| srgb8_from_linear(c.clamp(0.003, 0.88)));
        [r, g, b, alpha]
    });
    for [u, v, du, dv, length] in scratches {
        let steps = (length * width as f32) as usize;
        for k in 0..steps {
            let t = length * k as f32 / steps as f32;
            let at =
                |from: f32, step: f32, size: usize| (((from + t * step).rem_euclid(1.0)) * size as f32) as usize % size;
            let pixel = &mut worn[(at(u, du, width), at(v, dv, height))];
            for c in &mut pixel[..3] {
                *c = (f32::from(*c) * 0.82 + 12.0) as u8;
            }
        }
    }
    worn
}

/// Tangent-space normal map (+Y up) of an image used as a height map, with light parts above dark ones.
///
/// `depth_m` is the maximum height difference from the mean, `texel_m` the width and height of a texel.
pub(crate) fn normal_map(picture: &Image<[u8; 4]>, texel_m: [f32; 2], depth_m: f32) -> Image<[u8; 4]> {
    let (width, height) = (picture.width(), picture.height());
    let light = picture.map(|&[r, g, b, _]| luminance([r, g, b].map(linear_from_srgb8)));
    let mean = (light.pixels().iter().sum::<f32>() / (width * height) as f32).max(1e-3);
    let high = light.map(|l| depth_m * (0.5 * (l / mean - 1.0)).clamp(-1.0, 1.0));
    Image::from_fn(width, height, |x, y| {
        let (left, right) = (high[((x + width - 1) % width, y)], high[((x + 1) % width, y)]);
        let (up, down) = (high[(x, (y + height - 1) % height)], high[(x, (y + 1) % height)]);
        let slope = [(right - left) / (2.0 * texel_m[0]), (down - up) / (2.0 * texel_m[1])];
        // Rows run down, the bitangent points up.
        let normal = lo_geometry::Vec3::new(-slope[0], slope[1], 1.0).normalize();
        let code = |c: f32| ((0.5 * c + 0.5) * 255.0).round() as u8;
        [code(normal.x), code(normal.y), code(normal.z), 255]
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn relief_of_a_ridge_leans_to_both_sides() {
        // Light in the middle columns.
        let ridge =
            Image::from_fn(
                32,
                32,
                |x, _| if (12..20).contains(&x) { [220u8, 220, 220, 255] } else { [90, 90, 90, 255] },
            );
        let normals = normal_map(&ridge, [0.004, 0.004], 0.004);
        assert_eq!(normals[(16, 5)], [128, 128, 255, 255]);
        // The left side faces left, the right side faces right, equally steep.
        let (left, right) = (normals[(12, 5)], normals[(19, 5)]);
        assert!(left[0] < 110 && right[0] > 146 && left[0].abs_diff(255 - right[0]) <= 1, "{left:?} {right:?}");
        // A step that is light above and dark below faces down: less green.
        let step = Image::from_fn(32, 32, |_, y| if y < 16 { [220u8, 220, 220, 255] } else { [90, 90, 90, 255] });
        assert!(normal_map(&step, [0.004, 0.004], 0.004)[(8, 15)][1] < 110);
    }

    #[test]
    fn wear_darkens_in_places_and_leaves_most_as_it_was() {
        let white = Image::new(256, 256, vec![[220u8, 220, 220, 255]; 256 * 256]);
        let mut share = 0.0;
        for seed in 0..6 {
            let old = apply_wear(&white, seed, 0.8);
            share += old.pixels().iter().filter(|p| p[0] < 195).count() as f32 / (6.0 * 65536.0);
        }
        assert!((0.005..0.4).contains(&share), "{share}");
        assert_eq!(apply_wear(&white, 3, 0.8), apply_wear(&white, 3, 0.8));
    }
}
