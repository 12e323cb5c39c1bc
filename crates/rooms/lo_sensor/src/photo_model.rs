use lo_random::{RngExt, Stream};
use serde::{Deserialize, Serialize};

use crate::{Interval, PhoneModel, PhotoSettings, ResponseCurve};

/// Parameter ranges of cameras. [`PhotoModel::draw`] chooses one camera.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct PhotoModel {
    /// Target mean level of the automatic exposure, relative to white. The grey card is 0.18.
    pub grey_level: Interval,
    /// Exposure error, in stops.
    pub exposure_error_ev: Interval,
    /// Share of the image that may be clipped before the exposure is lowered.
    pub highlight_share: Interval,
    /// Share of the illuminant's colour that the white balance removes.
    pub white_balance: Interval,
    /// Error of the red and blue gains, as a natural logarithm.
    pub white_balance_error: Interval,
    /// Share of the lens's natural falloff (cos⁴ of the angle) that remains after in-camera correction.
    pub vignetting: Interval,
    /// Standard deviation of the blur (lens, defocus, motion, resampling), in pixels of the photo.
    pub blur_px: Interval,
    /// ISO sensitivity, uniform in stops.
    pub iso: Interval,
    /// Sensor pixels per photo pixel, which determine the noise of a downscaled image. Uniform in stops.
    pub binned_pixels: Interval,
    /// JPEG quality, 1 to 100.
    pub jpeg_quality: Interval,
    /// Relative frequency of each family of response curves.
    pub curves: CurveShares,
    /// Image processing of phones.
    pub phone: PhoneModel,
    /// Share of photos with a flash, among those with known depth, normals and base colours.
    pub flash_share: f32,
    /// Intensity of the flash in candela, uniform in stops. Phone lamps give 30 to 100 lx at a metre, a compact
    /// camera's flash tube more.
    pub flash_cd: Interval,
}

/// Relative frequencies of the [`ResponseCurve`] families.
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
    /// Phones and compact cameras indoors.
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
            phone: PhoneModel::default(),
            flash_share: 0.0,
            flash_cd: Interval::new(30.0, 400.0),
        }
    }
}

impl PhotoModel {
    /// Chooses a camera and its settings.
    pub fn draw(&self, stream: &mut Stream) -> PhotoSettings {
        let (mut phone, mut flash) = (lo_random::substream(stream, "phone"), lo_random::substream(stream, "flash"));
        let (phone, cast) = self.phone.draw(&mut phone).unzip();
        let flashes = flash.random::<f32>() < self.flash_share;
        let mut settings = PhotoSettings {
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
            phone,
            flash_cd: flashes.then(|| self.flash_cd.within(0.0, 1e6).draw_log(&mut flash)),
        };
        if let Some(cast) = cast {
            settings.white_balance_error[0] += cast;
            settings.white_balance_error[1] -= cast;
        }
        settings
    }
}

impl CurveShares {
    /// Chooses a family by its share, uniformly if no share is positive, then the family's parameter.
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

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn models_draw_within_their_ranges_and_always_the_same() {
        let model = PhotoModel::default();
        let draws: Vec<PhotoSettings> = (0..400).map(|i| model.draw(&mut lo_random::stream(9, "photo", i))).collect();
        assert_eq!(draws[7], model.draw(&mut lo_random::stream(9, "photo", 7)));
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
            // 100 expected, standard deviation 8.7
            assert!((65..=135).contains(&count), "family {family}: {count}");
        }
        let phones = PhotoModel {
            phone: PhoneModel { share: 0.5, cast: Interval::new(0.2, 0.2), ..PhoneModel::default() },
            flash_share: 0.25,
            ..model
        };
        let others: Vec<PhotoSettings> = (0..400).map(|i| phones.draw(&mut lo_random::stream(9, "photo", i))).collect();
        let count = |test: fn(&PhotoSettings) -> bool| others.iter().filter(|d| test(d)).count();
        // 200 and 100 expected, standard deviations 10 and 8.7
        let (developed, lit) = (count(|d| d.phone.is_some()), count(|d| d.flash_cd.is_some()));
        assert!((160..=240).contains(&developed) && (65..=135).contains(&lit), "{developed} {lit}");
        // Nothing else differs.
        for (one, other) in draws.iter().zip(&others) {
            let error = other.white_balance_error;
            let cast = if other.phone.is_some() { 0.2 } else { 0.0 };
            assert!((error[0] - one.white_balance_error[0] - cast).abs() < 1e-6);
            assert!((error[1] - one.white_balance_error[1] + cast).abs() < 1e-6);
            let same =
                PhotoSettings { phone: None, flash_cd: None, white_balance_error: one.white_balance_error, ..*other };
            assert_eq!(same, *one);
        }
        let text = serde_json::to_string(&draws[0]).unwrap();
        assert!(!text.contains("phone") && !text.contains("flash"), "shards of former settings keep their bytes");
        assert_eq!(serde_json::from_str::<PhotoSettings>(&text).unwrap(), draws[0]);
        assert_eq!(serde_json::from_str::<PhotoModel>("{}").unwrap(), model);
    }
}
