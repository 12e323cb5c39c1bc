//! The mean vertical profile of a dataset's panoramas: how bright it is at which height, compared with the photo.

use dataset::Sample;
use geometry::{Vec3, pixel_direction};
use imaging::luminance;
use serde::{Deserialize, Serialize};

use crate::baseline::mean_colour;

/// Bands of equal height in elevation, from straight down to straight up.
const BANDS: usize = 32;
/// Photos darker than this say nothing about ratios.
const LEAST_LUMINANCE: f32 = 1e-3;

/// Luminance of panoramas over the mean luminance of their photos, for bands of elevation.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Profile {
    /// 1.
    format_version: u32,
    /// Photos that it is the mean of.
    samples: usize,
    /// What their dataset calls itself.
    dataset: String,
    /// From −90° to 90°: `exp(mean ln(1 + ratio)) − 1`, the constant that a log-L2 loss (SPEC §6) would choose.
    factors: Vec<f32>,
}

/// Why a profile cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum ProfileError {
    /// Not the JSON that is written.
    #[error("no profile: {0}")]
    Json(#[from] serde_json::Error),
    /// Values out of range.
    #[error("no profile: {0}")]
    Content(String),
}

/// Adds up the profiles of many samples.
#[derive(Clone, Debug, Default)]
pub struct ProfileBuilder {
    sums: Vec<[f64; 2]>,
    samples: usize,
}

impl ProfileBuilder {
    /// Takes in all panoramas of a sample.
    pub fn add(&mut self, sample: &Sample) {
        let mean = luminance(mean_colour(sample));
        if mean < LEAST_LUMINANCE || sample.views.is_empty() {
            return;
        }
        self.samples += 1;
        self.sums.resize(BANDS, [0.0; 2]);
        let up = sample.up.unwrap_or(Vec3::Y);
        for view in &sample.views {
            let (width, height) = (view.radiance.width(), view.radiance.height());
            for y in 0..height {
                let angle = f64::from(geometry::pixel_solid_angle_sr(y, width, height));
                for x in 0..width {
                    let direction = view.rotation * pixel_direction(x, y, width, height);
                    let band = (height_of(direction, up) * BANDS as f32) as usize;
                    let ratio = f64::from(luminance(view.radiance[(x, y)]).max(0.0) / mean);
                    let sums = &mut self.sums[band.min(BANDS - 1)];
                    *sums = [sums[0] + angle * ratio.ln_1p(), sums[1] + angle];
                }
            }
        }
    }

    /// The profile; `None` where no sample had a panorama. Bands that small panoramas left out take their neighbour's value.
    pub fn finish(self, dataset: &str) -> Option<Profile> {
        let covered = |band: &usize| self.sums[*band][1] > 0.0;
        let nearest = |band: usize| (0..self.sums.len()).filter(covered).min_by_key(|other| other.abs_diff(band));
        let factors: Vec<f32> = (0..self.sums.len())
            .filter_map(nearest)
            .map(|band| (self.sums[band][0] / self.sums[band][1]).exp_m1() as f32)
            .collect();
        let dataset = dataset.to_owned();
        (!factors.is_empty()).then_some(Profile { format_version: 1, samples: self.samples, dataset, factors })
    }
}

impl Profile {
    /// Reads what was written with serde.
    ///
    /// # Errors
    /// Says what is wrong with it.
    pub fn from_json(bytes: &[u8]) -> Result<Self, ProfileError> {
        let profile: Self = serde_json::from_slice(bytes)?;
        let good = |factors: &[f32]| !factors.is_empty() && factors.iter().all(|v| v.is_finite() && *v >= 0.0);
        if profile.format_version != 1 {
            return Err(ProfileError::Content(format!("format_version is {}, not 1", profile.format_version)));
        }
        if !good(&profile.factors) {
            return Err(ProfileError::Content("factors must be finite and not negative".to_owned()));
        }
        Ok(profile)
    }

    /// Factor in a unit direction, between the bands' middles by interpolation.
    pub fn at(&self, direction: Vec3, up: Vec3) -> f32 {
        let last = self.factors.len() - 1;
        let position = (height_of(direction, up) * self.factors.len() as f32 - 0.5).clamp(0.0, last as f32);
        let first = position as usize;
        let share = position - first as f32;
        self.factors[first] * (1.0 - share) + self.factors[(first + 1).min(last)] * share
    }

    /// Photos that it is the mean of.
    pub fn samples(&self) -> usize {
        self.samples
    }
}

/// Elevation from straight down, 0, to straight up, 1.
fn height_of(direction: Vec3, up: Vec3) -> f32 {
    0.5 + direction.dot(up).clamp(-1.0, 1.0).asin() / std::f32::consts::PI
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::testing;
    use dataset::NovelView;
    use geometry::Quat;
    use imaging::{RadianceImage, linear_from_srgb8};

    #[test]
    fn a_known_profile_comes_back_however_the_camera_is_turned() {
        let grey = linear_from_srgb8(128);
        let mut builder = ProfileBuilder::default();
        for (angle, factor) in [(0.0, 1.0f32), (0.4, 3.0)] {
            let rotation = Quat::from_rotation_x(angle);
            let mut sample = testing::sample();
            sample.up = Some(rotation * Vec3::Y);
            // twice or six times as bright as the photo above the horizon, dark below
            let radiance = RadianceImage::from_fn(128, 64, |_, y| [if y < 32 { 2.0 * factor * grey } else { 0.0 }; 3]);
            sample.views = vec![NovelView { position_m: Vec3::ZERO, rotation, radiance, depth_m: None }];
            builder.add(&sample);
        }
        let profile = builder.finish("test").unwrap();
        // e^((ln 3 + ln 7) / 2) − 1
        let expected = 21f32.sqrt() - 1.0;
        let at = |y: f32| profile.at(Vec3::new(0.0, y, 0.7).normalize(), Vec3::Y);
        assert!((at(0.6) - expected).abs() < 1e-3 && at(-0.6) < 1e-6, "{}", at(0.6));
        let copy = Profile::from_json(&serde_json::to_vec(&profile).unwrap()).unwrap();
        assert_eq!((copy.samples(), &copy), (2, &profile));
        assert!(Profile::from_json(b"{\"factors\":[]}").is_err());
        let wrong = serde_json::json!({"format_version": 1, "samples": 1, "dataset": "x", "factors": [-1.0]});
        assert!(Profile::from_json(wrong.to_string().as_bytes()).unwrap_err().to_string().contains("negative"));
        assert!(ProfileBuilder::default().finish("none").is_none());
    }
}
