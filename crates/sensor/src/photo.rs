use geometry::Camera;
use image::ExtendedColorType;
use image::codecs::jpeg::JpegEncoder;
use imaging::{Image, Photo, RadianceImage, srgb8_from_linear};
use rand_distr::{Distribution, StandardNormal};
use random::{RngExt, Stream};
use serde::{Deserialize, Serialize};

use crate::metering::{Metering, meter};
use crate::{Interval, ResponseCurve};

/// Electrons that a phone's pixel holds at white and base sensitivity (1 µm pixels: some 6,000).
const FULL_WELL_E: f32 = 6000.0;

/// Sensitivity at which white fills the pixel.
const BASE_ISO: f32 = 50.0;

/// Read noise of one pixel in electrons, standard deviation.
const READ_NOISE_E: f32 = 2.0;

/// Cameras and their settings, as ranges: [`PhotoModel::draw`] makes one of them.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct PhotoModel {
    /// Mean level, of white, that the automatic exposure aims at; the grey card is 0.18.
    pub grey_level: Interval,
    /// What the exposure is wrong by, in stops.
    pub exposure_error_ev: Interval,
    /// Share of the picture that may be clipped before the exposure is lowered.
    pub highlight_share: Interval,
    /// Share of the illuminant's colour that the white balance takes out.
    pub white_balance: Interval,
    /// What the gains of red and of blue are wrong by, as a natural logarithm.
    pub white_balance_error: Interval,
    /// Share of the lens' natural falloff (cos⁴ of the angle) that is left after the camera's own correction.
    pub vignetting: Interval,
    /// Standard deviation of the blur (lens, defocus, motion, resampling) in pixels of the photo.
    pub blur_px: Interval,
    /// Sensitivity; uniform in stops.
    pub iso: Interval,
    /// Sensor pixels that make one pixel of the photo, which is the noise's share of a reduced picture; uniform in stops.
    pub binned_pixels: Interval,
    /// JPEG quality, 1 to 100.
    pub jpeg_quality: Interval,
    /// How often each family of response curves occurs.
    pub curves: CurveShares,
}

/// Relative frequencies of the families of [`ResponseCurve`].
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct CurveShares {
    /// [`ResponseCurve::Srgb`].
    pub srgb: f32,
    /// [`ResponseCurve::Filmic`].
    pub filmic: f32,
    /// [`ResponseCurve::Contrast`].
    pub contrast: f32,
    /// [`ResponseCurve::Shoulder`].
    pub shoulder: f32,
}

impl Default for CurveShares {
    fn default() -> Self {
        Self { srgb: 0.25, filmic: 0.25, contrast: 0.25, shoulder: 0.25 }
    }
}

impl Default for PhotoModel {
    /// Phones and compact cameras in rooms.
    fn default() -> Self {
        Self {
            grey_level: Interval::new(0.14, 0.24),
            exposure_error_ev: Interval::new(-0.7, 0.7),
            highlight_share: Interval::new(0.02, 0.25),
            white_balance: Interval::new(0.6, 1.0),
            white_balance_error: Interval::new(-0.08, 0.08),
            vignetting: Interval::new(0.0, 0.5),
            blur_px: Interval::new(0.2, 0.8),
            iso: Interval::new(50.0, 1600.0),
            binned_pixels: Interval::new(8.0, 80.0),
            jpeg_quality: Interval::new(70.0, 97.0),
            curves: CurveShares::default(),
        }
    }
}

/// One camera's settings, as drawn.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct PhotoSettings {
    /// See [`PhotoModel::grey_level`].
    pub grey_level: f32,
    /// See [`PhotoModel::exposure_error_ev`].
    pub exposure_error_ev: f32,
    /// See [`PhotoModel::highlight_share`].
    pub highlight_share: f32,
    /// See [`PhotoModel::white_balance`].
    pub white_balance: f32,
    /// Errors of red and of blue, natural logarithms.
    pub white_balance_error: [f32; 2],
    /// See [`PhotoModel::vignetting`].
    pub vignetting: f32,
    /// See [`PhotoModel::blur_px`].
    pub blur_px: f32,
    /// Sensitivity.
    pub iso: f32,
    /// See [`PhotoModel::binned_pixels`].
    pub binned_pixels: f32,
    /// JPEG quality, 1 to 100.
    pub jpeg_quality: u8,
    /// The response.
    pub curve: ResponseCurve,
}

/// A photo and how it relates to the light that made it.
#[derive(Clone, Debug, PartialEq)]
pub struct Photograph {
    /// What the camera wrote.
    pub jpeg: Vec<u8>,
    /// The same, decoded: sRGB.
    pub photo: Image<[u8; 3]>,
    /// Radiance times this, per channel, is in units of the photo's white: exposure and white balance as set, errors included, *before*
    /// vignetting and response. With [`ResponseCurve::Srgb`], no noise and no vignetting, 1.0 is sRGB 255.
    pub gains: [f32; 3],
}

impl PhotoModel {
    /// Chooses a camera and its settings.
    pub fn draw(&self, stream: &mut Stream) -> PhotoSettings {
        PhotoSettings {
            grey_level: self.grey_level.within(0.01, 0.9).draw(stream),
            exposure_error_ev: self.exposure_error_ev.within(-10.0, 10.0).draw(stream),
            highlight_share: self.highlight_share.within(0.0, 1.0).draw(stream),
            white_balance: self.white_balance.within(0.0, 1.0).draw(stream),
            white_balance_error: [(); 2].map(|()| self.white_balance_error.within(-1.0, 1.0).draw(stream)),
            vignetting: self.vignetting.within(0.0, 1.0).draw(stream),
            blur_px: self.blur_px.within(0.0, 16.0).draw(stream),
            iso: self.iso.within(1.0, 1e6).draw_log(stream),
            binned_pixels: self.binned_pixels.within(0.01, 1e4).draw_log(stream),
            jpeg_quality: self.jpeg_quality.within(1.0, 100.0).draw(stream).round() as u8,
            curve: self.curves.draw(stream),
        }
    }
}

impl CurveShares {
    /// A family by its share, all alike where no share is positive; then the family's parameter.
    fn draw(&self, stream: &mut Stream) -> ResponseCurve {
        let mut shares = [self.srgb, self.filmic, self.contrast, self.shoulder].map(|s| s.max(0.0));
        if shares.iter().sum::<f32>() <= 0.0 {
            shares = [1.0; 4];
        }
        let mut rest = stream.random::<f32>() * shares.iter().sum::<f32>();
        let family = shares.iter().position(|share| {
            rest -= share;
            rest < 0.0
        });
        match family {
            Some(0) => ResponseCurve::Srgb,
            Some(1) => ResponseCurve::Filmic { white: Interval::new(2.0, 8.0).draw_log(stream) },
            Some(2) => ResponseCurve::Contrast { slope: Interval::new(1.05, 1.35).draw(stream) },
            _ => ResponseCurve::Shoulder { strength: Interval::new(0.3, 4.0).draw_log(stream) },
        }
    }
}

impl PhotoSettings {
    /// Takes the photo of `radiance`, any units; `stream` makes the noise.
    ///
    /// Exposure and white balance ([`meter`]) with their errors, vignetting, blur, shot and read noise on linear light, the response
    /// with its clipping, 8-bit sRGB, JPEG.
    ///
    /// # Panics
    /// Where the image has not the camera's size, or a side of more than 65,535 pixels, which a JPEG cannot have.
    pub fn photograph(&self, radiance: &RadianceImage, camera: &Camera, stream: &mut Stream) -> Photograph {
        let size = (radiance.width() as u32, radiance.height() as u32);
        assert_eq!(size, (camera.width, camera.height), "the camera must be that of the image");
        let gains = self.gains(radiance);
        let mut light = self.optics(radiance, camera, gains);
        self.add_noise(&mut light, gains, stream);
        let respond = self.curve.prepared();
        let developed = light.map(|rgb| rgb.map(|v| srgb8_from_linear(respond(v))));
        let mut jpeg = Vec::new();
        JpegEncoder::new_with_quality(&mut jpeg, self.jpeg_quality.clamp(1, 100))
            .encode(developed.pixels().as_flattened(), size.0, size.1, ExtendedColorType::Rgb8)
            .expect("a camera's picture has pixels and fits into a JPEG");
        let photo = match imaging::photo_from_bytes(&jpeg, "photo.jpg").map(|file| file.photo) {
            Ok(Photo::Srgb8(photo)) => photo,
            _ => developed,
        };
        Photograph { jpeg, photo, gains }
    }

    /// See [`Photograph::gains`].
    fn gains(&self, radiance: &RadianceImage) -> [f32; 3] {
        let metering = Metering {
            grey_level: self.grey_level,
            highlight_share: self.highlight_share,
            white_balance: self.white_balance,
        };
        let [r, g, b] = meter(radiance, &metering).map(|gain| gain * self.exposure_error_ev.exp2());
        [r * self.white_balance_error[0].exp(), g, b * self.white_balance_error[1].exp()]
    }

    /// Exposed light behind the lens.
    fn optics(&self, radiance: &RadianceImage, camera: &Camera, gains: [f32; 3]) -> RadianceImage {
        let exposed = RadianceImage::from_fn(radiance.width(), radiance.height(), |x, y| {
            let [r, g, b] = radiance[(x, y)];
            let cosine = -camera.direction(x as f64 + 0.5, y as f64 + 0.5).z;
            let falloff = 1.0 - self.vignetting * (1.0 - cosine.powi(4));
            [r * gains[0], g * gains[1], b * gains[2]].map(|v| if v.is_finite() { v.max(0.0) * falloff } else { 0.0 })
        });
        blurred(&exposed, self.blur_px)
    }

    /// Electrons of an output pixel at white.
    fn white_electrons(&self) -> f32 {
        FULL_WELL_E * self.binned_pixels * BASE_ISO / self.iso
    }

    /// Shot noise (Poisson, by a normal distribution of the same variance) and read noise, before the white balance's gain.
    fn add_noise(&self, light: &mut RadianceImage, gains: [f32; 3], stream: &mut Stream) {
        let green = gains[1];
        let electrons = gains.map(|gain| self.white_electrons() * green / gain);
        let read_variance = READ_NOISE_E * READ_NOISE_E * self.binned_pixels;
        for pixel in light.pixels_mut() {
            for (value, electrons) in pixel.iter_mut().zip(electrons) {
                let mean = *value * electrons;
                let normal: f32 = StandardNormal.sample(stream);
                *value = ((mean + normal * (mean + read_variance).sqrt()) / electrons).max(0.0);
            }
        }
    }
}

/// Gaussian blur; beyond the border the border's pixels go on.
fn blurred(image: &RadianceImage, sigma_px: f32) -> RadianceImage {
    let radius = (3.0 * sigma_px).ceil() as usize;
    if radius == 0 || image.pixels().is_empty() {
        return image.clone();
    }
    let mut weights: Vec<f32> = (0..=radius).map(|i| (-0.5 * (i as f32 / sigma_px).powi(2)).exp()).collect();
    let total = weights[0] + 2.0 * weights[1..].iter().sum::<f32>();
    weights.iter_mut().for_each(|w| *w /= total);
    let (width, height) = (image.width(), image.height());
    let pass = |source: &RadianceImage, dx: usize, dy: usize| {
        RadianceImage::from_fn(width, height, |x, y| {
            let mut sum = source[(x, y)].map(|v| v * weights[0]);
            for (i, weight) in weights.iter().enumerate().skip(1) {
                let before = source[(x.saturating_sub(i * dx), y.saturating_sub(i * dy))];
                let after = source[((x + i * dx).min(width - 1), (y + i * dy).min(height - 1))];
                for c in 0..3 {
                    sum[c] += weight * (before[c] + after[c]);
                }
            }
            sum
        })
    };
    pass(&pass(image, 1, 0), 0, 1)
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use imaging::linear_from_srgb8;

    use super::*;

    /// A camera that adds nothing.
    fn neutral() -> PhotoSettings {
        PhotoSettings {
            grey_level: 0.18,
            exposure_error_ev: 0.0,
            highlight_share: 1.0,
            white_balance: 0.0,
            white_balance_error: [0.0; 2],
            vignetting: 0.0,
            blur_px: 0.0,
            iso: 1.0,
            binned_pixels: 1e4,
            jpeg_quality: 100,
            curve: ResponseCurve::Srgb,
        }
    }

    fn camera() -> Camera {
        Camera::from_hfov_deg(70.0, 120, 80).unwrap()
    }

    fn gradient() -> RadianceImage {
        RadianceImage::from_fn(120, 80, |x, _| [0.02 + x as f32 * 0.05; 3])
    }

    #[test]
    fn a_neutral_photo_gives_the_radiance_back() {
        let taken = neutral().photograph(&gradient(), &camera(), &mut random::stream(1, "test", 0));
        for x in (0..120).step_by(7) {
            let expected = (gradient()[(x, 40)][0] * taken.gains[0]).min(1.0);
            let got = linear_from_srgb8(taken.photo[(x, 40)][0]);
            // two steps of 8 bits where the sRGB curve is steepest, and JPEG at quality 100
            assert!((got - expected).abs() < 0.02, "{x}: {got} instead of {expected}");
        }
        let decoded = imaging::photo_from_bytes(&taken.jpeg, "p.jpg").unwrap().photo;
        assert_eq!(decoded, Photo::Srgb8(taken.photo), "what is kept is what was written");
    }

    #[test]
    fn exposure_and_balance_errors_are_part_of_the_gains() {
        let settings = PhotoSettings { exposure_error_ev: 1.0, white_balance_error: [0.1, -0.2], ..neutral() };
        let (wrong, right) = (settings.gains(&gradient()), neutral().gains(&gradient()));
        assert!((wrong[1] / right[1] - 2.0).abs() < 1e-5);
        assert!((wrong[0] / right[0] - 2.0 * 0.1f32.exp()).abs() < 1e-4);
        assert!((wrong[2] / right[2] - 2.0 * (-0.2f32).exp()).abs() < 1e-4);
    }

    #[test]
    fn noise_has_the_variance_of_its_electrons() {
        let settings = PhotoSettings { iso: 800.0, binned_pixels: 4.0, ..neutral() };
        // 6000 · 4 · 50 / 800 electrons at white; 4 pixels of 2 electrons each
        let (white, read) = (1500.0f32, 16.0f32);
        for level in [0.02f32, 0.2, 0.8] {
            let mut light = RadianceImage::new(300, 200, vec![[level; 3]; 60_000]);
            settings.add_noise(&mut light, [2.0, 1.0, 1.0], &mut random::stream(3, "test", 0));
            for (channel, electrons) in [(0, white / 2.0), (1, white)] {
                let values: Vec<f64> = light.pixels().iter().map(|p| f64::from(p[channel])).collect();
                let mean = values.iter().sum::<f64>() / 60_000.0;
                let variance = values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / 60_000.0;
                let expected = f64::from((level * electrons + read) / electrons.powi(2));
                // the estimate's own deviation is √(2/60000) = 0.6 %; black's clipping takes a little at the lowest level
                assert!((variance / expected - 1.0).abs() < 0.03, "{level}: {variance} instead of {expected}");
                assert!((mean / f64::from(level) - 1.0).abs() < 0.01);
            }
        }
    }

    #[test]
    fn vignetting_follows_the_fourth_power_of_the_cosine() {
        let settings = PhotoSettings { vignetting: 1.0, ..neutral() };
        let wall = RadianceImage::new(120, 80, vec![[1.0; 3]; 9600]);
        let light = settings.optics(&wall, &camera(), [1.0; 3]);
        let cosine = -camera().direction(0.5, 40.5).z;
        assert!((light[(0, 40)][1] - cosine.powi(4)).abs() < 1e-5);
        // at the edge of 70° across: cos⁴ 35° = 0.45
        assert!((light[(0, 40)][1] - 0.45).abs() < 0.01 && light[(60, 40)][1] > 0.999);
    }

    #[test]
    fn blur_keeps_light_and_has_the_stated_width() {
        let mut point = RadianceImage::new(41, 41, vec![[0.0; 3]; 41 * 41]);
        point[(20, 20)] = [100.0; 3];
        let spread = blurred(&point, 1.5);
        let sum: f32 = spread.pixels().iter().map(|p| p[0]).sum();
        assert!((sum - 100.0).abs() < 0.01);
        let second: f32 =
            (0..41).map(|x| (0..41).map(|y| spread[(x, y)][0]).sum::<f32>() * (x as f32 - 20.0).powi(2)).sum();
        // variance of the Gaussian cut at 3.3 σ
        assert!((second / 100.0 - 2.25).abs() < 0.08, "{}", second / 100.0);
    }

    #[test]
    fn models_draw_within_their_ranges_and_always_the_same() {
        let model = PhotoModel::default();
        let draws: Vec<PhotoSettings> = (0..400).map(|i| model.draw(&mut random::stream(9, "photo", i))).collect();
        assert_eq!(draws[7], model.draw(&mut random::stream(9, "photo", 7)));
        assert!(draws.iter().all(|d| (70..=97).contains(&d.jpeg_quality) && (50.0..=1600.0).contains(&d.iso)));
        for family in 0..4 {
            let count = draws
                .iter()
                .filter(|d| {
                    family
                        == match d.curve {
                            ResponseCurve::Srgb => 0,
                            ResponseCurve::Filmic { .. } => 1,
                            ResponseCurve::Contrast { .. } => 2,
                            ResponseCurve::Shoulder { .. } => 3,
                        }
                })
                .count();
            // 100 expected, deviation 8.7
            assert!((65..=135).contains(&count), "family {family}: {count}");
        }
        let text = serde_json::to_string(&draws[0]).unwrap();
        assert_eq!(serde_json::from_str::<PhotoSettings>(&text).unwrap(), draws[0]);
        assert_eq!(serde_json::from_str::<PhotoModel>("{}").unwrap(), model);
    }

    #[test]
    fn photos_are_the_same_for_the_same_stream_and_differ_for_others() {
        let take = |seed| neutral_noisy().photograph(&gradient(), &camera(), &mut random::stream(seed, "noise", 0));
        fn neutral_noisy() -> PhotoSettings {
            PhotoSettings { iso: 1600.0, binned_pixels: 8.0, jpeg_quality: 90, ..neutral() }
        }
        assert_eq!(take(1).jpeg, take(1).jpeg);
        assert_ne!(take(1).jpeg, take(2).jpeg);
    }
}
