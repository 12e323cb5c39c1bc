//! Photo detail: radiance relative to its own low frequencies.

use lo_geometry::{Camera, Vec2, Vec3};
use lo_imaging::{Image, RadianceImage};
use rayon::prelude::*;

use crate::photo::{PhotoPyramid, bilinear};

/// Greatest longer sides of the ratio and of the low frequencies, in pixels.
const SIDE: usize = 1024;
const LOW_SIDE: usize = 96;

/// Standard deviation of the blur that extracts the low frequencies, in radians.
const SIGMA_RAD: f32 = 0.6;

/// Least and greatest ratio, before the mean is normalised to 1.
const RANGE: (f32, f32) = (0.1, 20.0);

/// Share of the photo's mean that is added to numerator and denominator; darker values are noise.
const FLOOR: f32 = 0.02;

/// Computes the ratio of the photo to its low frequencies, per channel, at every scale. Its mean is 1 over any
/// neighbourhood.
pub(crate) fn ratio_pyramid(photo: &PhotoPyramid, camera: &Camera) -> PhotoPyramid {
    let low = photo.level_within(LOW_SIDE);
    let sigma_px = |width: usize| SIGMA_RAD * camera.fx as f32 * width as f32 / camera.width as f32;
    let mean = low.pixels().iter().map(|rgb| Vec3::from(*rgb)).sum::<Vec3>() / low.pixels().len() as f32;
    let floor = Vec3::splat(FLOOR * mean.max_element().max(1e-9));
    let base = blurred(low, sigma_px(low.width()));
    let (least, largest) = (Vec3::splat(RANGE.0), Vec3::splat(RANGE.1));
    let clamped =
        zipped(photo.level_within(SIDE), &base, |own, base| ((own + floor) / (base + floor)).clamp(least, largest));
    // Neither the clamp nor the quotient of two means preserves the mean.
    let clamped = PhotoPyramid::of(clamped);
    let low = clamped.level_within(LOW_SIDE);
    let mean = blurred(low, sigma_px(low.width()));
    PhotoPyramid::of(zipped(clamped.level_within(SIDE), &mean, |own, mean| own / mean.max(least)))
}

/// Combines each pixel of an image with the value of a coarser image at the same position.
fn zipped(fine: &RadianceImage, coarse: &RadianceImage, combine: impl Fn(Vec3, Vec3) -> Vec3 + Sync) -> RadianceImage {
    let (width, height) = (fine.width(), fine.height());
    let scale = Vec2::new(coarse.width() as f32 / width as f32, coarse.height() as f32 / height as f32);
    let pixel = |x: usize, y: usize| {
        let at = (Vec2::new(x as f32, y as f32) + 0.5) * scale;
        combine(Vec3::from(fine[(x, y)]), bilinear(coarse, at)).to_array()
    };
    let rows: Vec<Vec<[f32; 3]>> =
        (0..height).into_par_iter().map(|y| (0..width).map(|x| pixel(x, y)).collect()).collect();
    Image::new(width, height, rows.into_iter().flatten().collect())
}

/// Applies a Gaussian blur; the image is mirrored at its borders.
fn blurred(image: &RadianceImage, sigma_px: f32) -> RadianceImage {
    let reach = (3.0 * sigma_px).ceil() as isize;
    let weights: Vec<f32> = (-reach..=reach).map(|i| (-0.5 * (i as f32 / sigma_px).powi(2)).exp()).collect();
    let total: f32 = weights.iter().sum();
    let (width, height) = (image.width(), image.height());
    let mirrored = |i: isize, size: usize| {
        let turned = i.rem_euclid(2 * size as isize) as usize;
        turned.min(2 * size - 1 - turned)
    };
    let along = |image: &RadianceImage, (dx, dy): (isize, isize)| {
        let pixel = |x: usize, y: usize| {
            let at = |i: isize| (mirrored(x as isize + i * dx, width), mirrored(y as isize + i * dy, height));
            let sum: Vec3 = (-reach..=reach).zip(&weights).map(|(i, weight)| Vec3::from(image[at(i)]) * *weight).sum();
            (sum / total).to_array()
        };
        let rows: Vec<Vec<[f32; 3]>> =
            (0..height).into_par_iter().map(|y| (0..width).map(|x| pixel(x, y)).collect()).collect();
        Image::new(width, height, rows.into_iter().flatten().collect())
    };
    along(&along(image, (1, 0)), (0, 1))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_mean_of_the_ratio_is_one() {
        // Halves of very different brightness, squares on both, and a lamp a hundred times as bright as the mean.
        let photo = Image::from_fn(256, 192, |x, y| {
            let square = if (x / 16 + y / 16) % 2 == 0 { 1.5 } else { 0.5 };
            let lamp = if (40..44).contains(&x) && (40..44).contains(&y) { 40.0 } else { 0.0 };
            let half = if x < 128 { 0.05 } else { 0.6 };
            [half * square + lamp, half, 0.3 * square]
        });
        let camera = Camera::from_hfov_deg(70.0, 256, 192).expect("a valid lens");
        let ratio = ratio_pyramid(&PhotoPyramid::of(photo), &camera);
        let whole = ratio.level_within(1);
        assert!((Vec3::from(whole.pixels()[0]) - 1.0).abs().max_element() < 0.15, "{whole:?}");
        let fine = ratio.level_within(256);
        let blue: Vec<f32> = fine.pixels().iter().map(|rgb| rgb[2]).collect();
        // The contrast of the squares, 1 ± 0.5.
        assert!(blue.iter().all(|v| (v - 1.5).abs() < 0.15 || (v - 0.5).abs() < 0.15));
    }
}
