//! Image processing of phones after the sensor: denoising, local tone mapping, sharpening. Phones choose the
//! sensitivity by the scene's light.

use lo_imaging::{Image, RadianceImage, luminance};
use lo_random::{RngExt, Stream};
use serde::{Deserialize, Serialize};

use crate::blur::blurred;
use crate::{Interval, ResponseCurve, UNIT_CD_M2};

/// Parameter ranges of a phone's processing.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct PhoneModel {
    /// Share of photos taken by a phone.
    pub share: f32,
    /// Strength of denoising, in standard deviations of the noise. 0 disables it; 3 and more also smear texture.
    pub denoising: Interval,
    /// Share of the large-scale contrast (in stops) that local tone mapping removes. Details are amplified by as much.
    pub compression: Interval,
    /// Amount of the unsharp mask.
    pub sharpening: Interval,
    /// Standard deviation of the unsharp mask's blur in pixels: the width of the halos. Uniform in stops.
    pub halo_px: Interval,
    /// Colour cast from warm to cold, added to the white balance's error: natural logarithm, added to red and
    /// subtracted from blue.
    pub cast: Interval,
    /// Exposure time in seconds, uniform in stops. Together with the scene's light (in units of 100 cd/m²) it
    /// determines the sensitivity.
    pub shutter_s: Interval,
    /// Minimum and maximum sensitivity.
    pub iso: Interval,
}

impl Default for PhoneModel {
    fn default() -> Self {
        Self {
            share: 0.0,
            denoising: Interval::new(0.0, 5.0),
            compression: Interval::new(0.0, 0.5),
            sharpening: Interval::new(0.0, 1.6),
            halo_px: Interval::new(0.5, 2.5),
            cast: Interval::new(-0.18, 0.18),
            shutter_s: Interval::new(0.01, 0.07),
            iso: Interval::new(25.0, 12_800.0),
        }
    }
}

/// Settings of one phone's processing.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct PhoneSettings {
    /// See [`PhoneModel::denoising`].
    pub denoising: f32,
    /// See [`PhoneModel::compression`].
    pub compression: f32,
    /// See [`PhoneModel::sharpening`].
    pub sharpening: f32,
    /// See [`PhoneModel::halo_px`].
    pub halo_px: f32,
    /// See [`PhoneModel::shutter_s`].
    pub shutter_s: f32,
    /// See [`PhoneModel::iso`].
    pub iso: [f32; 2],
}

/// F-number of phone lenses.
const F_NUMBER: f32 = 1.8;
/// Constant of reflected-light meters (ISO 2720), in cd s/m².
const METER_K: f32 = 12.5;

/// Half side of the base layer's window, as a share of the image's longer side.
const BASE_RADIUS: f32 = 0.04;
/// Variance in stops² above which an edge belongs to the base layer.
const BASE_EDGE: f32 = 0.5;
/// Light that counts as black, relative to white.
const BLACK: f32 = 1e-4;

/// Half side of the denoiser's window in pixels, and the standard deviation of its spatial weight.
const WINDOW_PX: isize = 2;
const WINDOW_SIGMA_PX: f32 = 1.6;

impl PhoneModel {
    /// Chooses a phone's processing and its colour cast. `None` if the photo is not by a phone.
    pub(crate) fn draw(&self, stream: &mut Stream) -> Option<(PhoneSettings, f32)> {
        (stream.random::<f32>() < self.share).then(|| {
            let settings = PhoneSettings {
                denoising: self.denoising.within(0.0, 100.0).draw(stream),
                compression: self.compression.within(0.0, 1.0).draw(stream),
                sharpening: self.sharpening.within(0.0, 10.0).draw(stream),
                halo_px: self.halo_px.within(0.1, 16.0).draw_log(stream),
                shutter_s: self.shutter_s.within(1e-5, 100.0).draw_log(stream),
                iso: self.iso.within(1.0, 1e6).into(),
            };
            (settings, self.cast.within(-1.0, 1.0).draw(stream))
        })
    }
}

impl PhoneSettings {
    /// Returns the sensitivity at which radiance (in units of 100 cd/m²) times `gain` is exposed light. From H = q L t
    /// / N² and ISO 2720's meter, `S = K N² / (t L)`, with L the luminance that becomes the grey card.
    pub(crate) fn sensitivity(&self, gain: f32) -> f32 {
        let grey_cd_m2 = ResponseCurve::GREY / gain.max(f32::MIN_POSITIVE) * UNIT_CD_M2;
        (METER_K * F_NUMBER * F_NUMBER / (self.shutter_s * grey_cd_m2)).clamp(self.iso[0], self.iso[1])
    }

    /// Denoises and tone-maps exposed light. `white_electrons` is the number of electrons at 1, which sets the shot
    /// noise.
    pub(crate) fn develop(&self, light: &RadianceImage, white_electrons: f32) -> RadianceImage {
        let smooth = denoised(light, self.denoising, white_electrons);
        compressed(&smooth, self.compression)
    }

    /// Applies the unsharp mask to sRGB codes. Overshoots at edges are its halos.
    pub(crate) fn sharpened(&self, photo: &Image<[u8; 3]>) -> Image<[u8; 3]> {
        let codes = photo.map(|rgb| rgb.map(f32::from));
        let soft = blurred(&codes, self.halo_px);
        Image::from_fn(photo.width(), photo.height(), |x, y| {
            let (sharp, soft) = (codes[(x, y)], soft[(x, y)]);
            std::array::from_fn(|c| (sharp[c] + self.sharpening * (sharp[c] - soft[c])).round().clamp(0.0, 255.0) as u8)
        })
    }
}

/// Bilateral filter (Tomasi & Manduchi 1998) on square roots, where shot noise has constant variance (Anscombe 1948).
/// Averages pixels that differ by less than `strength` standard deviations of green.
fn denoised(light: &RadianceImage, strength: f32, white_electrons: f32) -> RadianceImage {
    if strength <= 0.0 {
        return light.clone();
    }
    let roots = light.map(|rgb| rgb.map(|v| v.max(0.0).sqrt()));
    // √x of a Poisson variable of mean m has standard deviation ½; in units of white's root that is ½ / √electrons.
    let deviation = strength * 0.5 / white_electrons.max(f32::MIN_POSITIVE).sqrt();
    let (width, height) = (light.width(), light.height());
    let by_distance: Vec<f32> = (-WINDOW_PX..=WINDOW_PX)
        .flat_map(|dy| (-WINDOW_PX..=WINDOW_PX).map(move |dx| (dx * dx + dy * dy) as f32))
        .map(|squared| (-0.5 * squared / (WINDOW_SIGMA_PX * WINDOW_SIGMA_PX)).exp())
        .collect();
    let scale = -0.5 / (3.0 * deviation * deviation);
    let clamp = |i: isize, end: usize| i.clamp(0, end as isize - 1) as usize;
    Image::from_fn(width, height, |x, y| {
        let own = roots[(x, y)];
        let (mut sum, mut weights) = ([0.0f32; 3], 0.0);
        let mut window = by_distance.iter();
        for dy in -WINDOW_PX..=WINDOW_PX {
            let row = clamp(y as isize + dy, height);
            for dx in -WINDOW_PX..=WINDOW_PX {
                let other = roots[(clamp(x as isize + dx, width), row)];
                let difference: f32 = (0..3).map(|c| (other[c] - own[c]).powi(2)).sum();
                let weight = window.next().copied().unwrap_or(0.0) * (scale * difference).exp();
                (0..3).for_each(|c| sum[c] += weight * other[c]);
                weights += weight;
            }
        }
        sum.map(|v| (v / weights).powi(2))
    })
}

/// Local tone mapping with a base and a detail layer (Durand & Dorsey, "Fast Bilateral Filtering for the Display of
/// High-Dynamic-Range Images", SIGGRAPH 2002). Removes `share` of the base's distance from the grey card, in stops.
/// Details are amplified by `1 + share`.
fn compressed(light: &RadianceImage, share: f32) -> RadianceImage {
    if share <= 0.0 || light.pixels().is_empty() {
        return light.clone();
    }
    let stops = light.map(|rgb| luminance(*rgb).max(BLACK).log2());
    let radius = (BASE_RADIUS * light.width().max(light.height()) as f32).ceil() as usize;
    let base = base_layer(&stops, radius);
    RadianceImage::from_fn(light.width(), light.height(), |x, y| {
        let detail = stops[(x, y)] - base[(x, y)];
        let factor = (share * (ResponseCurve::GREY.log2() - base[(x, y)] + detail)).exp2();
        light[(x, y)].map(|v| v * factor)
    })
}

/// Edge-preserving guided filter of an image by itself (He, Sun & Tang, "Guided Image Filtering", TPAMI 2013, equations
/// 5 to 8).
fn base_layer(picture: &Image<f32>, radius: usize) -> Image<f32> {
    let mean = box_mean(picture, radius);
    let square = box_mean(&picture.map(|v| v * v), radius);
    let at = |x: usize, y: usize| {
        let variance = (square[(x, y)] - mean[(x, y)] * mean[(x, y)]).max(0.0);
        variance / (variance + BASE_EDGE)
    };
    let (width, height) = (picture.width(), picture.height());
    let slope = Image::from_fn(width, height, at);
    let offset = Image::from_fn(width, height, |x, y| (1.0 - slope[(x, y)]) * mean[(x, y)]);
    let (slope, offset) = (box_mean(&slope, radius), box_mean(&offset, radius));
    Image::from_fn(width, height, |x, y| slope[(x, y)] * picture[(x, y)] + offset[(x, y)])
}

/// Mean over a square of `2 radius + 1` pixels, cropped to the image.
fn box_mean(picture: &Image<f32>, radius: usize) -> Image<f32> {
    let (width, height) = (picture.width(), picture.height());
    let line = |length: usize, value: &dyn Fn(usize) -> f32| -> Vec<f32> {
        let mut sums = vec![0.0f64; length + 1];
        (0..length).for_each(|i| sums[i + 1] = sums[i] + f64::from(value(i)));
        let mean = |i: usize| {
            let (from, to) = (i.saturating_sub(radius), (i + radius + 1).min(length));
            ((sums[to] - sums[from]) / (to - from) as f64) as f32
        };
        (0..length).map(mean).collect()
    };
    let rows: Vec<f32> = (0..height).flat_map(|y| line(width, &|x| picture[(x, y)])).collect();
    let columns: Vec<Vec<f32>> = (0..width).map(|x| line(height, &|y| rows[y * width + x])).collect();
    Image::from_fn(width, height, |x, y| columns[x][y])
}

#[cfg(test)]
mod tests {
    use lo_random::RngExt;

    use super::*;

    const PHONE: PhoneSettings = PhoneSettings {
        denoising: 3.0,
        compression: 0.5,
        sharpening: 1.0,
        halo_px: 1.0,
        shutter_s: 1.0 / 30.0,
        iso: [25.0, 12_800.0],
    };

    #[test]
    fn dark_rooms_are_taken_with_a_high_sensitivity() {
        // 100 cd/m² as 18 % grey: 12.5 · 1.8² · 30 / 100.
        assert!((PHONE.sensitivity(0.18) / 12.15 - 1.0).abs() < 1e-4 || PHONE.sensitivity(0.18) == 25.0);
        // A hundredth of the light.
        assert!((PHONE.sensitivity(18.0) / 1215.0 - 1.0).abs() < 1e-4);
        assert_eq!(PHONE.sensitivity(1e9), 12_800.0);
    }

    #[test]
    fn local_tone_mapping_moves_contrast_from_regions_to_details() {
        // Two halves five stops apart around the grey card, each with stripes of a tenth of a stop.
        let light = RadianceImage::from_fn(160, 80, |x, y| {
            let region = if x < 80 { -2.5f32 } else { 2.5 };
            let stripe = if (y / 2) % 2 == 0 { 0.05 } else { -0.05 };
            [ResponseCurve::GREY * (region + stripe).exp2(); 3]
        });
        let mapped = compressed(&light, 0.5);
        let stops = |x: usize, y: usize| (mapped[(x, y)][0] / ResponseCurve::GREY).log2();
        let contrast = stops(130, 40) - stops(30, 40);
        assert!((contrast - 2.5).abs() < 0.1, "{contrast} stops");
        let detail = stops(30, 40) - stops(30, 42);
        assert!((detail.abs() - 0.15).abs() < 0.03, "{detail} stops");
    }

    #[test]
    fn denoising_removes_noise_smears_fine_texture_and_keeps_edges() {
        let mut random = lo_random::stream(1, "test", 0);
        let electrons = 400.0f32;
        let noisy = RadianceImage::from_fn(80, 40, |x, _| {
            let level = if x < 40 { 0.1f32 } else { 0.6 };
            [(); 3].map(|()| level + (random.random::<f32>() - 0.5) * 12f32.sqrt() * (level / electrons).sqrt())
        });
        let smooth = denoised(&noisy, 3.0, electrons);
        let deviation = |image: &RadianceImage| {
            let values: Vec<f32> = (5..35).flat_map(|y| (45..75).map(move |x| (x, y))).map(|at| image[at][1]).collect();
            let mean = values.iter().sum::<f32>() / values.len() as f32;
            (values.iter().map(|v| (v - mean).powi(2)).sum::<f32>() / values.len() as f32).sqrt()
        };
        assert!(deviation(&smooth) < 0.4 * deviation(&noisy), "{} of {}", deviation(&smooth), deviation(&noisy));
        let edge = (smooth[(42, 20)][1] - smooth[(37, 20)][1]) / 0.5;
        assert!((edge - 1.0).abs() < 0.15, "{edge}");
        // Texture of the noise's amplitude is removed with it.
        let texture = RadianceImage::from_fn(40, 40, |x, _| [0.6 + if x % 2 == 0 { 0.02 } else { -0.02 }; 3]);
        let left = denoised(&texture, 3.0, electrons);
        assert!((left[(20, 20)][1] - left[(21, 20)][1]).abs() < 0.02);
    }

    #[test]
    fn sharpening_overshoots_at_edges() {
        let photo = Image::from_fn(40, 8, |x, _| if x < 20 { [100u8; 3] } else { [150; 3] });
        let sharp = PHONE.sharpened(&photo);
        assert!(sharp[(20, 4)][0] > 160 && sharp[(19, 4)][0] < 90, "{} {}", sharp[(20, 4)][0], sharp[(19, 4)][0]);
        assert_eq!((sharp[(3, 4)], sharp[(36, 4)]), ([100; 3], [150; 3]));
    }
}
