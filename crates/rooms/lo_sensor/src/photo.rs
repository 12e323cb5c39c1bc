use image::ExtendedColorType;
use image::codecs::jpeg::JpegEncoder;
use lo_geometry::Camera;
use lo_imaging::{Image, Photo, RadianceImage, srgb8_from_linear};
use lo_random::Stream;
use rand_distr::{Distribution, StandardNormal};
use serde::{Deserialize, Serialize};

use crate::blur::blurred;
use crate::flash::add_flash;
use crate::metering::{Metering, meter};
use crate::{DepthView, PhoneSettings, ResponseCurve};

/// Electrons of a phone's pixel at white and base sensitivity (1 µm pixels: about 6,000).
const FULL_WELL_E: f32 = 6000.0;

/// ISO sensitivity at which white fills the pixel.
const BASE_ISO: f32 = 50.0;

/// Read noise of one pixel in electrons (standard deviation).
const READ_NOISE_E: f32 = 2.0;

/// Settings of one camera.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct PhotoSettings {
    /// See [`PhotoModel::grey_level`](crate::PhotoModel::grey_level).
    pub grey_level: f32,
    /// See [`PhotoModel::exposure_error_ev`](crate::PhotoModel::exposure_error_ev).
    pub exposure_error_ev: f32,
    /// See [`PhotoModel::highlight_share`](crate::PhotoModel::highlight_share).
    pub highlight_share: f32,
    /// See [`PhotoModel::white_balance`](crate::PhotoModel::white_balance).
    pub white_balance: f32,
    /// Errors of the red and blue gains, natural logarithms.
    pub white_balance_error: [f32; 2],
    /// See [`PhotoModel::vignetting`](crate::PhotoModel::vignetting).
    pub vignetting: f32,
    /// See [`PhotoModel::blur_px`](crate::PhotoModel::blur_px).
    pub blur_px: f32,
    /// ISO sensitivity.
    pub iso: f32,
    /// See [`PhotoModel::binned_pixels`](crate::PhotoModel::binned_pixels).
    pub binned_pixels: f32,
    /// JPEG quality, 1 to 100.
    pub jpeg_quality: u8,
    /// Response curve.
    pub curve: ResponseCurve,
    /// A phone's processing. If set, the phone chooses the sensitivity by the light and `iso` is ignored.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub phone: Option<PhoneSettings>,
    /// Intensity of the flash straight ahead, in candela. `None` without a flash.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub flash_cd: Option<f32>,
}

/// Photo and its relation to the scene's radiance.
#[derive(Clone, Debug, PartialEq)]
pub struct Photograph {
    /// Encoded file.
    pub jpeg: Vec<u8>,
    /// Decoded file, sRGB.
    pub photo: Image<[u8; 3]>,
    /// Per-channel factors from radiance to units of the photo's white: exposure and white balance as set, including
    /// errors, *before* vignetting and response. With [`ResponseCurve::Srgb`], no noise and no vignetting, 1.0 is sRGB
    /// 255.
    pub gains: [f32; 3],
}

impl PhotoSettings {
    /// Simulates a photo of `radiance` (any units). `stream` provides the noise.
    ///
    /// Steps: exposure and white balance ([`meter`]) with their errors, vignetting, blur, shot and read noise on linear
    /// light, a phone's denoising and local tone mapping, response curve with clipping, 8-bit sRGB, a phone's
    /// sharpening, JPEG. A flash must already be in the radiance; see [`with_flash`](Self::with_flash).
    ///
    /// # Panics
    /// If the image's size differs from the camera's, or a side exceeds 65,535 pixels, the limit of JPEG.
    pub fn photograph(&self, radiance: &RadianceImage, camera: &Camera, stream: &mut Stream) -> Photograph {
        let size = (radiance.width() as u32, radiance.height() as u32);
        assert_eq!(size, (camera.width, camera.height), "the camera's size must match the image's");
        let gains = self.gains(radiance);
        let mut light = self.optics(radiance, camera, gains);
        let iso = self.phone.map_or(self.iso, |phone| phone.sensitivity(gains[1]));
        let settings = Self { iso, ..*self };
        settings.add_noise(&mut light, gains, stream);
        if let Some(phone) = &self.phone {
            light = phone.develop(&light, settings.white_electrons());
        }
        let respond = self.curve.prepared();
        let mut developed = light.map(|rgb| rgb.map(|v| srgb8_from_linear(respond(v))));
        if let Some(phone) = &self.phone {
            developed = phone.sharpened(&developed);
        }
        let mut jpeg = Vec::new();
        JpegEncoder::new_with_quality(&mut jpeg, self.jpeg_quality.clamp(1, 100))
            .encode(developed.pixels().as_flattened(), size.0, size.1, ExtendedColorType::Rgb8)
            .expect("the image has pixels and fits into a JPEG");
        let photo = match lo_imaging::photo_from_bytes(&jpeg, "photo.jpg").map(|file| file.photo) {
            Ok(Photo::Srgb8(photo)) => photo,
            _ => developed,
        };
        Photograph { jpeg, photo, gains }
    }

    /// Returns the radiance with the camera's flash added, if it has one. `radiance` is in units of 100 cd/m².
    ///
    /// # Panics
    /// If the view's size differs from the image's.
    pub fn with_flash(&self, radiance: RadianceImage, view: &DepthView) -> RadianceImage {
        match self.flash_cd {
            Some(intensity_cd) => add_flash(&radiance, view, intensity_cd),
            None => radiance,
        }
    }

    /// Returns the [`Photograph::gains`].
    fn gains(&self, radiance: &RadianceImage) -> [f32; 3] {
        let metering = Metering {
            grey_level: self.grey_level,
            highlight_share: self.highlight_share,
            white_balance: self.white_balance,
        };
        let [r, g, b] = meter(radiance, &metering).map(|gain| gain * self.exposure_error_ev.exp2());
        [r * self.white_balance_error[0].exp(), g, b * self.white_balance_error[1].exp()]
    }

    /// Returns the exposed light behind the lens.
    fn optics(&self, radiance: &RadianceImage, camera: &Camera, gains: [f32; 3]) -> RadianceImage {
        let exposed = RadianceImage::from_fn(radiance.width(), radiance.height(), |x, y| {
            let [r, g, b] = radiance[(x, y)];
            let cosine = -camera.direction(x as f64 + 0.5, y as f64 + 0.5).z;
            let falloff = 1.0 - self.vignetting * (1.0 - cosine.powi(4));
            [r * gains[0], g * gains[1], b * gains[2]].map(|v| if v.is_finite() { v.max(0.0) * falloff } else { 0.0 })
        });
        blurred(&exposed, self.blur_px)
    }

    /// Returns the electrons of an output pixel at white.
    fn white_electrons(&self) -> f32 {
        FULL_WELL_E * self.binned_pixels * BASE_ISO / self.iso
    }

    /// Adds shot noise (Poisson, approximated by a normal distribution of the same variance) and read noise. Both arise
    /// before the white balance's gain.
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

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use lo_imaging::linear_from_srgb8;

    use super::*;

    /// A camera that changes nothing.
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
            phone: None,
            flash_cd: None,
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
        let taken = neutral().photograph(&gradient(), &camera(), &mut lo_random::stream(1, "test", 0));
        for x in (0..120).step_by(7) {
            let expected = (gradient()[(x, 40)][0] * taken.gains[0]).min(1.0);
            let got = linear_from_srgb8(taken.photo[(x, 40)][0]);
            // Two steps of 8 bits where the sRGB curve is steepest, and JPEG at quality 100.
            assert!((got - expected).abs() < 0.02, "{x}: {got} instead of {expected}");
        }
        let decoded = lo_imaging::photo_from_bytes(&taken.jpeg, "p.jpg").unwrap().photo;
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
        // 6000 · 4 · 50 / 800 electrons at white; 4 pixels of 2 electrons each.
        let (white, read) = (1500.0f32, 16.0f32);
        for level in [0.02f32, 0.2, 0.8] {
            let mut light = RadianceImage::new(300, 200, vec![[level; 3]; 60_000]);
            settings.add_noise(&mut light, [2.0, 1.0, 1.0], &mut lo_random::stream(3, "test", 0));
            for (channel, electrons) in [(0, white / 2.0), (1, white)] {
                let values: Vec<f64> = light.pixels().iter().map(|p| f64::from(p[channel])).collect();
                let mean = values.iter().sum::<f64>() / 60_000.0;
                let variance = values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / 60_000.0;
                let expected = f64::from((level * electrons + read) / electrons.powi(2));
                // The estimate's standard deviation is √(2/60000) = 0.6 %; clipping at black removes a little at the
                // lowest level.
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
        // At the edge of 70° horizontally: cos⁴ 35° = 0.45.
        assert!((light[(0, 40)][1] - 0.45).abs() < 0.01 && light[(60, 40)][1] > 0.999);
    }

    #[test]
    fn photos_are_the_same_for_the_same_stream_and_differ_for_others() {
        let take = |seed| neutral_noisy().photograph(&gradient(), &camera(), &mut lo_random::stream(seed, "noise", 0));
        fn neutral_noisy() -> PhotoSettings {
            PhotoSettings { iso: 1600.0, binned_pixels: 8.0, jpeg_quality: 90, ..neutral() }
        }
        assert_eq!(take(1).jpeg, take(1).jpeg);
        assert_ne!(take(1).jpeg, take(2).jpeg);
    }
}
