//! The photo's detail: its radiance relative to its own low frequencies.

use lo_geometry::{Camera, Vec2, Vec3};
use lo_imaging::{Image, RadianceImage};
use rayon::prelude::*;

use crate::photo::{PhotoPyramid, bilinear};

/// Longer sides of the ratio and of the low frequencies, pixels.
const SIDE: usize = 1024;
const LOW_SIDE: usize = 192;

/// Standard deviation of the blur that leaves the low frequencies, radians.
const SIGMA_RAD: f32 = 0.2;

/// Least and largest ratio before the mean is brought to 1: a clipped lamp among dark pixels would be a hundred.
const RANGE: (f32, f32) = (0.1, 6.0);

/// Radiance below which ratios are of noise, as a share of the photo's mean.
const FLOOR: f32 = 0.02;

/// The ratio of the photo to its low frequencies, by channel, at every scale: about 1 on average over any neighbourhood.
pub(crate) fn ratio_pyramid(photo: &PhotoPyramid, camera: &Camera) -> PhotoPyramid {
    let sigma = std::env::var("D_SIGMA").ok().map_or(SIGMA_RAD, |v| v.parse().unwrap());
    let hi = std::env::var("D_MAX").ok().map_or(RANGE.1, |v| v.parse().unwrap());
    let lo = std::env::var("D_MIN").ok().map_or(RANGE.0, |v| v.parse().unwrap());
    let gamma = std::env::var("D_GAMMA").ok().map_or(1.0, |v| v.parse().unwrap());
    let fine = photo.level_within(SIDE);
    let low = photo.level_within(LOW_SIDE);
    let sigma_px = sigma * (camera.fx / f64::from(camera.width)) as f32 * low.width() as f32;
    let mean = low.pixels().iter().map(|rgb| Vec3::from(*rgb)).sum::<Vec3>() / low.pixels().len() as f32;
    let floor = Vec3::splat(FLOOR * mean.max_element().max(1e-9));
    let base = blurred(low, sigma_px);
    let over = |image: &RadianceImage, of: &RadianceImage, change: &(dyn Fn(Vec3, Vec3) -> Vec3 + Sync)| {
        let (width, height) = (image.width(), image.height());
        let scale = Vec2::new(of.width() as f32 / width as f32, of.height() as f32 / height as f32);
        let rows: Vec<Vec<[f32; 3]>> = (0..height)
            .into_par_iter()
            .map(|y| {
                let at = |x: usize| (Vec2::new(x as f32, y as f32) + 0.5) * scale;
                (0..width).map(|x| change(Vec3::from(image[(x, y)]), bilinear(of, at(x))).to_array()).collect()
            })
            .collect();
        Image::new(width, height, rows.into_iter().flatten().collect())
    };
    let raw = over(fine, &base, &|own, base| {
        ((own + floor) / (base + floor)).powf(gamma).clamp(Vec3::splat(lo), Vec3::splat(hi))
    });
    // What the clamp, and the correlation of both, took or gave.
    let pyramid = PhotoPyramid::of(raw);
    let mean = blurred(pyramid.level_within(LOW_SIDE), sigma_px);
    let raw = pyramid.level_within(SIDE);
    PhotoPyramid::of(over(raw, &mean, &|own, mean| own / mean.max(Vec3::splat(1e-3))))
}

/// A Gaussian blur; the picture is mirrored at its borders.
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
        Image::from_fn(width, height, |x, y| {
            let at = |i: isize| (mirrored(x as isize + i * dx, width), mirrored(y as isize + i * dy, height));
            let sum: Vec3 = (-reach..=reach).zip(&weights).map(|(i, weight)| Vec3::from(image[at(i)]) * *weight).sum();
            (sum / total).to_array()
        })
    };
    along(&along(image, (1, 0)), (0, 1))
}
