//! Photos that no pinhole camera takes: panoramas and fisheyes.

use crate::bars::BLACK;
use crate::{Image, Photo, RadianceImage, luminance, srgb8_from_linear};

/// How an image that is no ordinary photo seems to be projected.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SpecialProjection {
    /// Equirectangular panorama of the whole sphere: twice as wide as high, its sides join, and a row at a pole shows
    /// one point.
    Equirectangular,
    /// Panorama stitched from a turning camera: more than three times as wide as high, or as high as wide.
    Panorama,
    /// The image of a fisheye lens: a disc in black.
    Fisheye,
    /// The images of two fisheye lenses side by side.
    DualFisheye,
}

/// Largest ratio of the sides of a photo of one pinhole camera; the widest cinema format has 2.76.
const MAX_ASPECT: f64 = 3.0;

/// Longer side of the image that is examined.
const LONG_SIDE: usize = 256;

impl SpecialProjection {
    /// Recognises a photo that no pinhole camera takes; `None` for all others.
    pub fn of(photo: &Photo) -> Option<Self> {
        let (width, height) = (photo.width(), photo.height());
        let aspect = width as f64 / height as f64;
        let image = reduced(photo);
        let is_double = (aspect / 2.0 - 1.0).abs() < 0.02;
        let half = |right: usize| {
            Image::from_fn(image.width() / 2, image.height(), |x, y| image[(right * (image.width() / 2) + x, y)])
        };
        match () {
            () if is_disc(&image) => Some(Self::Fisheye),
            () if is_double && is_disc(&half(0)) && is_disc(&half(1)) => Some(Self::DualFisheye),
            () if is_double && is_sphere(&image) => Some(Self::Equirectangular),
            () if aspect.max(aspect.recip()) >= MAX_ASPECT => Some(Self::Panorama),
            () => None,
        }
    }
}

/// The photo at a small size, by averages of blocks, with sRGB's gamma.
fn reduced(photo: &Photo) -> Image<[u8; 3]> {
    let (width, height) = (photo.width(), photo.height());
    let scale = (LONG_SIDE as f64 / width.max(height) as f64).min(1.0);
    let side = |pixels: usize| ((pixels as f64 * scale).round() as usize).max(1);
    let (columns, rows) = (side(width), side(height));
    let small = RadianceImage::from_fn(columns, rows, |x, y| {
        let span = |index: usize, count: usize, size: usize| {
            let start = index * size / count;
            start..((index + 1) * size / count).max(start + 1)
        };
        let (mut sum, mut count) = ([0.0f32; 3], 0.0f32);
        // Every other pixel of large blocks is enough.
        let step = (width / columns / 4).max(1);
        for v in span(y, rows, height).step_by(step) {
            for u in span(x, columns, width).step_by(step) {
                let rgb = photo.linear_at((u, v));
                (0..3).for_each(|c| sum[c] += if rgb[c].is_finite() { rgb[c].clamp(0.0, 16.0) } else { 0.0 });
                count += 1.0;
            }
        }
        sum.map(|c| c / count)
    });
    small.map(|rgb| rgb.map(srgb8_from_linear))
}

/// Whether the image is a bright disc around its middle, and black outside.
fn is_disc(image: &Image<[u8; 3]>) -> bool {
    let (width, height) = (image.width(), image.height());
    let is_black = |x: usize, y: usize| image[(x, y)].iter().all(|&c| c <= BLACK);
    let lit = || (0..height).flat_map(|y| (0..width).map(move |x| (x, y))).filter(|&(x, y)| !is_black(x, y));
    let Some((mut left, mut top)) = lit().next() else { return false };
    let (mut right, mut bottom) = (left, top);
    for (x, y) in lit() {
        (left, right, top, bottom) = (left.min(x), right.max(x), top.min(y), bottom.max(y));
    }
    let (box_width, box_height) = ((right - left + 1) as f64, (bottom - top + 1) as f64);
    // A disc that is cut at two sides is as high or wide as the image.
    let radius = 0.5 * box_width.max(box_height);
    let (cx, cy) = (0.5 * (left + right + 1) as f64, 0.5 * (top + bottom + 1) as f64);
    let is_centred = (cx / width as f64 - 0.5).abs() < 0.12 && (cy / height as f64 - 0.5).abs() < 0.12;
    let is_round = box_width.min(box_height) > 1.2 * radius && radius > 0.3 * width.min(height) as f64;
    if !(is_centred && is_round) {
        return false;
    }
    let (mut outside, mut black_outside, mut rim, mut black_rim) = (0.0f64, 0.0f64, 0.0f64, 0.0f64);
    for (x, y) in (0..height).flat_map(|y| (0..width).map(move |x| (x, y))) {
        let distance = (x as f64 + 0.5 - cx).hypot(y as f64 + 0.5 - cy) / radius;
        let black = f64::from(u8::from(is_black(x, y)));
        if distance > 1.03 {
            outside += 1.0;
            black_outside += black;
        } else if (0.85..0.97).contains(&distance) {
            rim += 1.0;
            black_rim += black;
        }
    }
    // The corners around a whole disc are a fifth of its square.
    outside > 0.08 * box_width * box_height && black_outside > 0.98 * outside && black_rim < 0.35 * rim
}

/// Whether the left and right side join, and the rows at the poles each show one point.
fn is_sphere(image: &Image<[u8; 3]>) -> bool {
    let (width, height) = (image.width(), image.height());
    if width < 32 || height < 16 {
        return false;
    }
    let grey = image.map(|rgb| luminance(rgb.map(f32::from)));
    let difference =
        |a: usize, b: usize| (0..height).map(|y| (grey[(a, y)] - grey[(b, y)]).abs()).sum::<f32>() / height as f32;
    let mean = |values: Vec<f32>| values.iter().sum::<f32>() / values.len().max(1) as f32;
    let near = mean((0..width - 1).map(|x| difference(x, x + 1)).collect());
    let far = mean((0..width).step_by(4).map(|x| difference(x, (x + width / 3) % width)).collect());
    let seam = difference(width - 1, 0);
    let spread = |y: usize| {
        let row: Vec<f32> = (0..width).map(|x| grey[(x, y)]).collect();
        let middle = mean(row.clone());
        mean(row.iter().map(|v| (v - middle).abs()).collect())
    };
    let typical = mean((height / 4..3 * height / 4).map(spread).collect());
    // A logo or a tripod may cover one pole.
    let pole = spread(0).min(spread(height - 1));
    seam < 2.5 * near + 1.0 && seam < 0.5 * far && pole < 0.3 * typical
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::{read_photo, read_radiance};
    use lo_testdata::{real_panoramas, real_photos, shared_data};

    fn texture(x: usize, y: usize) -> [u8; 3] {
        [(60 + (x * 3 + y) % 120) as u8, (50 + (y * 5) % 100) as u8, 90]
    }

    fn disc(width: usize, height: usize, centre: (f64, f64), radius: f64) -> Image<[u8; 3]> {
        Image::from_fn(width, height, |x, y| {
            let distance = (x as f64 + 0.5 - centre.0).hypot(y as f64 + 0.5 - centre.1);
            if distance < radius { texture(x, y) } else { [2, 0, 3] }
        })
    }

    fn found(image: Image<[u8; 3]>) -> Option<SpecialProjection> {
        SpecialProjection::of(&Photo::Srgb8(image))
    }

    #[test]
    fn discs_are_fisheyes() {
        let fisheye = Some(SpecialProjection::Fisheye);
        assert_eq!(found(disc(200, 200, (100.0, 100.0), 98.0)), fisheye);
        assert_eq!(found(disc(300, 200, (155.0, 102.0), 95.0)), fisheye);
        // cut at the top and bottom
        assert_eq!(found(disc(300, 200, (150.0, 100.0), 130.0)), fisheye);
        let [left, right] = [50.0, 150.0].map(|x| disc(200, 100, (x, 50.0), 49.0));
        let both = Image::from_fn(200, 100, |x, y| if x < 100 { left[(x, y)] } else { right[(x, y)] });
        assert_eq!(found(both), Some(SpecialProjection::DualFisheye));
        // a lamp in the dark, a vignette and bars are none
        assert_eq!(found(disc(300, 200, (60.0, 50.0), 40.0)), None);
        assert_eq!(found(disc(300, 200, (150.0, 100.0), 178.0)), None);
        let bars = |x, y| if (50..250).contains(&x) { texture(x, y) } else { [0; 3] };
        assert_eq!(found(Image::from_fn(300, 200, bars)), None);
    }

    #[test]
    fn wide_images_are_panoramas() {
        assert_eq!(found(Image::from_fn(620, 200, texture)), Some(SpecialProjection::Panorama));
        assert_eq!(found(Image::from_fn(100, 400, texture)), Some(SpecialProjection::Panorama));
        assert_eq!(found(Image::from_fn(480, 200, texture)), None);
    }

    #[test]
    fn real_panoramas_are_recognised() {
        let files = real_panoramas(&["hdr", "hdr_more", "hdr_extra"], "projection of real panoramas");
        let missed = files.iter().filter(|file| {
            let panorama = read_radiance(file).unwrap();
            let mut values: Vec<f32> = panorama.pixels().iter().map(|&rgb| luminance(rgb)).collect();
            let middle = values.len() / 2;
            let exposure = 0.2 / values.select_nth_unstable_by(middle, f32::total_cmp).1.max(1e-4);
            let photo = Photo::Linear(panorama.map(|rgb| rgb.map(|c| exposure * c)));
            SpecialProjection::of(&photo) != Some(SpecialProjection::Equirectangular)
        });
        let missed: Vec<_> = missed.map(|file| file.display().to_string()).collect();
        assert!(missed.len() * 20 <= files.len(), "{} of {}: {missed:?}", missed.len(), files.len());
    }

    #[test]
    fn real_photos_are_ordinary_and_the_samples_are_not() {
        for file in real_photos("projection of real photos") {
            let image = read_photo(&file).unwrap().photo.into_srgb8();
            // also cropped to 2 : 1
            let (width, height) = (image.width(), image.width() / 2);
            let wide =
                Image::from_fn(width, height, |x, y| image[(x, y + (image.height().saturating_sub(height)) / 2)]);
            for image in [image, wide] {
                assert_eq!(found(image), None, "{}", file.display());
            }
        }
        let Some(folder) = shared_data("inputs", "projection of samples") else { return };
        let of = |name: &str| SpecialProjection::of(&read_photo(folder.join(name)).unwrap().photo);
        assert_eq!(of("fisheye_circular.jpg"), Some(SpecialProjection::Fisheye));
        assert_eq!(of("phone_pano_180.jpg"), Some(SpecialProjection::Panorama));
        for name in ["base.jpg", "letterbox.png", "pillarbox.png", "square_crop_exif640.jpg"] {
            assert_eq!(of(name), None, "{name}");
        }
    }
}
