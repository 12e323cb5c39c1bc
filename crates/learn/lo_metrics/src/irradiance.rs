//! Irradiance of objects under an estimated panorama, compared with the true panorama.
//!
//! Irradiance is computed at 512 normals, the directions of a 16 × 32 equirectangular grid, with equal weights. It is
//! divided by π: the radiance of a white diffuse surface. Panoramas are resized to 128 × 64 pixels; 64 × 32 would
//! change contrasts by up to 0.5 %, those of small lamps by 3 %.

use std::sync::LazyLock;

use lo_geometry::{Vec3, pixel_direction, pixel_solid_angle_sr};
use lo_imaging::{RadianceImage, luminance, resize_equirectangular};
use serde::Serialize;

use crate::{angular_error_deg, si_rmse};

/// Size of the panoramas that are integrated.
const MAP: [usize; 2] = [128, 64];

/// Number of normals in azimuth and elevation.
const NORMALS: [usize; 2] = [32, 16];

/// Columns of the panorama per column of normals.
const STEP: usize = MAP[0] / NORMALS[0];

/// Upper limit of contrasts: with an unlit normal, the contrast would be infinite and spoil means.
pub const MAX_CONTRAST_STOPS: f64 = 20.0;

/// Anisotropy below which the direction of light is determined by rounding errors.
const MIN_ANISOTROPY: f64 = 1e-4;

/// Differences between a matte object lit by an estimated panorama and one lit by the true panorama.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct LightOnObjects {
    /// log₂ of largest ÷ smallest luminance irradiance under the estimate, at most [`MAX_CONTRAST_STOPS`].
    pub contrast_stops: f64,
    /// Contrast under the true panorama.
    pub true_contrast_stops: f64,
    /// `|∫ L ω dω| / ∫ L dω` of the estimate's luminance, in `[0, 1]`: 0 for even light, 1 for a point light.
    pub anisotropy: f64,
    /// Anisotropy of the true panorama.
    pub true_anisotropy: f64,
    /// Angle between the vector irradiances `∫ L ω dω`, degrees; `None` if one panorama is even.
    pub vector_deg: Option<f64>,
    /// `|log₂|` of the ratio of mean luminance irradiances.
    pub level_log2: f64,
    /// Scale-invariant RMSE ([`si_rmse`]) of the unseen part's irradiance, divided by the mean of the true one. `None`
    /// without unseen light.
    pub unseen_relative_si_rmse: Option<f64>,
    /// RGB angular error of the unseen part's irradiance, degrees ([`angular_error_deg`]).
    pub unseen_angular_deg: Option<f64>,
}

impl LightOnObjects {
    /// Compares panoramas of one size. Negative radiance counts as 0.
    ///
    /// `seen` is a mask of the pixels that the photo shows, row by row. Returns `None` if one panorama is black.
    ///
    /// # Panics
    /// If the sizes of panoramas and mask differ.
    pub fn compare(truth: &RadianceImage, got: &RadianceImage, seen: Option<&[bool]>) -> Option<Self> {
        assert_eq!((truth.width(), truth.height()), (got.width(), got.height()), "panoramas of one size");
        let maps = [truth, got].map(|map| lanes(map, seen));
        let irradiance = irradiance(&maps);
        let [(true_contrast_stops, true_mean), (contrast_stops, mean)] =
            [0, 1].map(|which| contrast(irradiance.iter().map(|lanes| f64::from(lanes[which][0]))));
        let [(true_anisotropy, true_vector), (anisotropy, vector)] = maps.each_ref().map(|map| anisotropy(map));
        if !(true_mean > 0.0 && mean > 0.0) {
            return None;
        }
        let has_direction = true_anisotropy > MIN_ANISOTROPY && anisotropy > MIN_ANISOTROPY;
        let unseen = |which: usize| {
            let colour = |lanes: &[Lanes; 2]| [lanes[which][1], lanes[which][2], lanes[which][3]];
            RadianceImage::new(NORMALS[0], NORMALS[1], irradiance.iter().map(colour).collect())
        };
        let (true_unseen, unseen) = (unseen(0), unseen(1));
        let unseen_mean = true_unseen.pixels().iter().flatten().map(|v| f64::from(*v)).sum::<f64>()
            / (3 * true_unseen.pixels().len()) as f64;
        let ones = vec![1.0; true_unseen.pixels().len()];
        Some(Self {
            contrast_stops,
            true_contrast_stops,
            anisotropy,
            true_anisotropy,
            vector_deg: has_direction.then(|| f64::from(true_vector.angle_between(vector)).to_degrees()),
            level_log2: (mean / true_mean).log2().abs(),
            unseen_relative_si_rmse: si_rmse(&true_unseen, &unseen, &ones)
                .filter(|_| unseen_mean > 0.0)
                .map(|error| error / unseen_mean),
            unseen_angular_deg: angular_error_deg(&true_unseen, &unseen, &ones),
        })
    }
}

/// Distribution of a panorama's luminance over the sphere.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct LightDistribution {
    /// log₂ of largest ÷ smallest irradiance over normals, at most [`MAX_CONTRAST_STOPS`].
    pub contrast_stops: f64,
    /// `|∫ L ω dω| / ∫ L dω`, in `[0, 1]`.
    pub anisotropy: f64,
    /// Vertical component of the direction of `∫ L ω dω`, in `[−1, 1]`: 1 for light from above.
    pub upward: f64,
    /// Share of `∫ L dω` from the brightest 1 % of the sphere.
    pub brightest_hundredth: f64,
    /// Share of `∫ L dω` from the brightest 5 % of the sphere.
    pub brightest_twentieth: f64,
}

impl LightDistribution {
    /// Measures a panorama; `None` if it is black. Negative radiance counts as 0.
    pub fn measure(panorama: &RadianceImage) -> Option<Self> {
        let map = lanes(panorama, None);
        let maps = [map.clone(), map];
        let (contrast_stops, mean) = contrast(irradiance(&maps).iter().map(|lanes| f64::from(lanes[0][0])));
        if mean <= 0.0 {
            return None;
        }
        let (anisotropy, vector) = anisotropy(&maps[0]);
        let [brightest_hundredth, brightest_twentieth] = [0.01, 0.05].map(|share| brightest(&maps[0], share));
        let upward = f64::from(vector.y);
        Some(Self { contrast_stops, anisotropy, upward, brightest_hundredth, brightest_twentieth })
    }
}

/// Returns the share of light from the brightest part of the sphere.
fn brightest(map: &[Lanes], share: f64) -> f64 {
    let solid_angle_sr = |index: usize| f64::from(pixel_solid_angle_sr(index / MAP[0], MAP[0], MAP[1]));
    let mut pixels: Vec<(f64, f64)> =
        map.iter().enumerate().map(|(index, lanes)| (f64::from(lanes[0]), solid_angle_sr(index))).collect();
    pixels.sort_by(|a, b| b.0.total_cmp(&a.0));
    let mut left_sr = share * pixels.iter().map(|pixel| pixel.1).sum::<f64>();
    let mut light = 0.0;
    for (radiance, solid_angle_sr) in &pixels {
        light += radiance * solid_angle_sr.min(left_sr);
        left_sr = (left_sr - solid_angle_sr).max(0.0);
    }
    light / pixels.iter().map(|(radiance, solid_angle_sr)| radiance * solid_angle_sr).sum::<f64>()
}

/// Luminance of the whole panorama, and RGB radiance of its unseen part.
type Lanes = [f32; 4];

/// Resizes a panorama to [`MAP`]; without a mask nothing is unseen.
fn lanes(map: &RadianceImage, seen: Option<&[bool]>) -> Vec<Lanes> {
    let map = map.map(|rgb| rgb.map(|v| v.max(0.0)));
    let resized = |map: &RadianceImage| {
        if [map.width(), map.height()] == MAP { map.clone() } else { resize_equirectangular(map, MAP[0], MAP[1]) }
    };
    let unseen = seen.map(|seen| {
        assert_eq!(map.pixels().len(), seen.len(), "a mask of the panorama's size");
        let pixels = map.pixels().iter().zip(seen).map(|(&rgb, &seen)| if seen { [0.0; 3] } else { rgb });
        resized(&RadianceImage::new(map.width(), map.height(), pixels.collect()))
    });
    let whole = resized(&map);
    let unseen = |index: usize| unseen.as_ref().map_or([0.0; 3], |unseen| unseen.pixels()[index]);
    let pixels = whole.pixels().iter().enumerate();
    pixels
        .map(|(index, &rgb)| {
            let [r, g, b] = unseen(index);
            [luminance(rgb), r, g, b]
        })
        .collect()
}

/// Cosine × solid angle / π by row of normals, row of the panorama, and column relative to the normal's.
///
/// One column of normals is enough: the next column's weights are the same, shifted by [`STEP`].
static COSINES: LazyLock<Vec<Vec<[f32; MAP[0]]>>> = LazyLock::new(|| {
    let row_of_normals = |n: usize| {
        let normal = pixel_direction(0, n, NORMALS[0], NORMALS[1]);
        let row = |y: usize| {
            let weight = pixel_solid_angle_sr(y, MAP[0], MAP[1]) / std::f32::consts::PI;
            std::array::from_fn(|x| normal.dot(pixel_direction(x, y, MAP[0], MAP[1])).max(0.0) * weight)
        };
        (0..MAP[1]).map(row).collect()
    };
    (0..NORMALS[1]).map(row_of_normals).collect()
});

/// Computes irradiance / π at every normal under two panoramas, row by row.
fn irradiance(maps: &[Vec<Lanes>; 2]) -> Vec<[Lanes; 2]> {
    // Each row is repeated, so that a rotated row is a slice.
    let pair = |index: usize| [maps[0][index], maps[1][index]];
    let row = |y: usize| (0..2 * MAP[0]).map(|x| pair(y * MAP[0] + x % MAP[0])).collect();
    let rows: Vec<Vec<[Lanes; 2]>> = (0..MAP[1]).map(row).collect();
    let mut result = Vec::with_capacity(NORMALS[0] * NORMALS[1]);
    for cosines in COSINES.iter() {
        for column in 0..NORMALS[0] {
            let mut sums = [[0.0f32; 4]; 2];
            for (weights, row) in cosines.iter().zip(&rows) {
                let mut row_sums = [[0.0f32; 4]; 2];
                for (weight, pixel) in weights.iter().zip(&row[column * STEP..]) {
                    for (sum, lanes) in row_sums.iter_mut().zip(pixel) {
                        (0..4).for_each(|lane| sum[lane] += weight * lanes[lane]);
                    }
                }
                for (sum, part) in sums.iter_mut().zip(row_sums) {
                    (0..4).for_each(|lane| sum[lane] += part[lane]);
                }
            }
            result.push(sums);
        }
    }
    result
}

/// Returns log₂ of the largest ÷ smallest value, and the mean.
fn contrast(values: impl Iterator<Item = f64>) -> (f64, f64) {
    let start = (f64::INFINITY, 0.0f64, 0.0);
    let (least, most, sum) = values.fold(start, |(least, most, sum), v| (v.min(least), v.max(most), v + sum));
    ((most / least).log2().min(MAX_CONTRAST_STOPS), sum / (NORMALS[0] * NORMALS[1]) as f64)
}

/// Returns the length of the vector irradiance over the scalar one, and the unit vector.
fn anisotropy(map: &[Lanes]) -> (f64, Vec3) {
    let (mut vector, mut scalar) = ([0.0f64; 3], 0.0);
    for (index, lanes) in map.iter().enumerate() {
        let (x, y) = (index % MAP[0], index / MAP[0]);
        let power = f64::from(lanes[0] * pixel_solid_angle_sr(y, MAP[0], MAP[1]));
        let direction = pixel_direction(x, y, MAP[0], MAP[1]).to_array();
        (0..3).for_each(|axis| vector[axis] += power * f64::from(direction[axis]));
        scalar += power;
    }
    let length = vector.iter().map(|v| v * v).sum::<f64>().sqrt();
    (length / scalar, Vec3::from(vector.map(|v| (v / length) as f32)))
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    fn panorama(size: [usize; 2], radiance: impl Fn(usize, usize) -> [f32; 3]) -> RadianceImage {
        RadianceImage::from_fn(size[0], size[1], radiance)
    }

    fn even(value: f32) -> RadianceImage {
        panorama(MAP, |_, _| [value; 3])
    }

    fn upper_half(rgb: [f32; 3]) -> RadianceImage {
        panorama(MAP, |_, y| if y < MAP[1] / 2 { rgb } else { [0.0; 3] })
    }

    #[test]
    fn even_light_has_neither_contrast_nor_direction() {
        let figures = LightOnObjects::compare(&even(2.0), &even(0.5), None).unwrap();
        // Sampling of the cosine's kink at the horizon causes errors of 0.05 %.
        assert!(figures.contrast_stops < 2e-3 && figures.true_contrast_stops < 2e-3, "{figures:?}");
        assert!(figures.anisotropy < 1e-6 && figures.vector_deg.is_none(), "{figures:?}");
        assert!((figures.level_log2 - 2.0).abs() < 1e-6);
        assert_eq!((figures.unseen_relative_si_rmse, figures.unseen_angular_deg), (None, None));
        assert_eq!(LightOnObjects::compare(&even(1.0), &even(0.0), None), None);
    }

    #[test]
    fn the_brightest_part_is_a_share_of_the_sphere() {
        let figures = LightDistribution::measure(&even(2.0)).unwrap();
        assert!((figures.brightest_hundredth - 0.01).abs() < 1e-6, "{figures:?}");
        // Radiance 9 and 1 in the two halves: the brightest 5 % have 0.05 · 9 of 5, and the vector is (9 − 1) / 4 of 5.
        let halves = panorama(MAP, |_, y| [if y < MAP[1] / 2 { 9.0 } else { 1.0 }; 3]);
        let figures = LightDistribution::measure(&halves).unwrap();
        assert!((figures.brightest_twentieth - 0.09).abs() < 1e-5, "{figures:?}");
        assert!((figures.upward - 1.0).abs() < 1e-4 && (figures.anisotropy - 0.4).abs() < 1e-3, "{figures:?}");
        assert_eq!(LightDistribution::measure(&even(0.0)), None);
    }

    #[test]
    fn a_small_lamp_has_the_cosine_law() {
        // One bright pixel in even light of radiance 0.1.
        let lamp = |at: (usize, usize)| panorama(MAP, |x, y| [if (x, y) == at { 500.0 } else { 0.1 }; 3]);
        let (a, b) = ((10, 20), (42, 20));
        let figures = LightOnObjects::compare(&lamp(a), &lamp(b), None).unwrap();
        let flux = 499.9 * f64::from(pixel_solid_angle_sr(20, MAP[0], MAP[1]));
        let direction = |(x, y): (usize, usize)| pixel_direction(x, y, MAP[0], MAP[1]);
        let cosine = |y: usize, x: usize| direction(a).dot(pixel_direction(x, y, NORMALS[0], NORMALS[1]));
        let nearest = (0..NORMALS[1]).flat_map(|y| (0..NORMALS[0]).map(move |x| cosine(y, x))).fold(0.0, f32::max);
        let stops = (1.0 + flux * f64::from(nearest) / (std::f64::consts::PI * 0.1)).log2();
        assert!((figures.contrast_stops - stops).abs() < 2e-3, "{figures:?} {stops}");
        assert!((figures.true_contrast_stops - stops).abs() < 2e-3, "{figures:?} {stops}");
        let anisotropy = flux / (flux + 0.4 * std::f64::consts::PI);
        assert!((figures.anisotropy - anisotropy).abs() < 1e-5, "{figures:?} {anisotropy}");
        let apart_deg = f64::from(direction(a).angle_between(direction(b)).to_degrees());
        assert!((figures.vector_deg.unwrap() - apart_deg).abs() < 1e-3, "{figures:?} {apart_deg}");
        assert!(figures.level_log2 < 1e-5);
        let alone = panorama(MAP, |x, y| [if (x, y) == a { 1.0 } else { 0.0 }; 3]);
        assert_eq!(LightOnObjects::compare(&alone, &alone, None).unwrap().contrast_stops, MAX_CONTRAST_STOPS);
    }

    #[test]
    fn half_a_sphere_of_light_falls_off_as_a_cardioid() {
        let half = upper_half([1.0; 3]);
        let maps = [lanes(&half, None), lanes(&half, None)];
        for (index, lanes) in irradiance(&maps).iter().enumerate() {
            let cosine = pixel_direction(index % NORMALS[0], index / NORMALS[0], NORMALS[0], NORMALS[1]).y;
            // Irradiance / π of a tilted hemisphere.
            assert!((lanes[0][0] - 0.5 * (1.0 + cosine)).abs() < 1e-3, "{index}: {} {cosine}", lanes[0][0]);
        }
        let figures = LightOnObjects::compare(&half, &half, None).unwrap();
        assert!((figures.anisotropy - 0.5).abs() < 1e-3, "{figures:?}");
        assert!(figures.vector_deg.unwrap() < 1e-2 && figures.level_log2 == 0.0, "{figures:?}");
    }

    #[test]
    fn colour_and_shape_are_those_of_the_unseen_part() {
        // The photo shows the lower half, which is wrong in both.
        let seen: Vec<bool> = (0..MAP[0] * MAP[1]).map(|index| index >= MAP[0] * MAP[1] / 2).collect();
        let truth = upper_half([1.0, 0.0, 0.0]);
        let mut got = upper_half([3.0, 3.0, 0.0]);
        got.pixels_mut()[MAP[0] * MAP[1] / 2..].fill([0.0, 0.0, 9.0]);
        let figures = LightOnObjects::compare(&truth, &got, Some(&seen)).unwrap();
        assert!((figures.unseen_angular_deg.unwrap() - 45.0).abs() < 1e-4, "{figures:?}");
        // Irradiance is h (1, 0, 0) and α h (1, 1, 0), α = 1/2: the error is RMS(h) / √6, the mean h / 3; h = (1 + cos)
        // / 2 with the mean of cos² 1/2.
        assert!((figures.unseen_relative_si_rmse.unwrap() - 1.5).abs() < 2e-3, "{figures:?}");
        let figures = LightOnObjects::compare(&truth, &got, Some(&vec![true; MAP[0] * MAP[1]])).unwrap();
        assert_eq!((figures.unseen_relative_si_rmse, figures.unseen_angular_deg), (None, None));
    }

    #[test]
    fn figures_are_those_of_numpy() {
        let map = |base: f32, lamp: f32, at: usize| {
            panorama(MAP, |x, y| {
                let height = ((y as f32 + 0.5) / MAP[1] as f32 * std::f32::consts::PI).cos();
                let lamp = if x.abs_diff(at) < 3 && y.abs_diff(14) < 2 { lamp } else { 0.0 };
                let light = base + 0.5 * height * height + lamp;
                [light, 0.8 * light + 0.001 * x as f32, 0.6 * light + 0.004 * y as f32]
            })
        };
        let seen = |index: usize| (40..88).contains(&(index % MAP[0])) && (20..44).contains(&(index / MAP[0]));
        let seen: Vec<bool> = (0..MAP[0] * MAP[1]).map(seen).collect();
        let figures = LightOnObjects::compare(&map(0.3, 60.0, 30), &map(0.5, 20.0, 50), Some(&seen)).unwrap();
        // `light` and `unseen` of the project's check light_contrast.py, which takes solid angles at the centres of
        // rows.
        let pairs = [
            (figures.contrast_stops, 0.487_619),
            (figures.true_contrast_stops, 1.037_512),
            (figures.anisotropy, 0.041_636),
            (figures.true_anisotropy, 0.157_578),
            (figures.vector_deg.unwrap(), 50.496_138),
            (figures.level_log2, 0.226_745),
            (figures.unseen_relative_si_rmse.unwrap(), 0.192_254),
            (figures.unseen_angular_deg.unwrap(), 1.479_996),
        ];
        for (got, expected) in pairs {
            assert!((got / expected - 1.0).abs() < 2e-3, "{got} {expected}");
        }
    }
}
