//! Mean vertical profile of a dataset's panoramas: brightness by elevation, relative to the photo.

use std::path::{Path, PathBuf};

use lo_dataset::{Dataset, DatasetError, Sample};
use lo_events::{Cancelled, OnEvent, Steps};
use lo_geometry::{Vec3, pixel_direction};
use lo_imaging::{linear_from_srgb8, luminance, mean_luminance};
use serde::{Deserialize, Serialize};

/// Number of bands of equal elevation range, from straight down to straight up.
const BANDS: usize = 32;
/// Photos of lower mean luminance are skipped.
const MIN_LUMINANCE: f32 = 1e-3;

/// Luminance of panoramas over the mean luminance of their photos, by band of elevation.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Profile {
    /// Version of the format: 1.
    format_version: u32,
    /// Number of photos averaged.
    samples: usize,
    /// Name of the dataset.
    dataset: String,
    /// `exp(mean ln(1 + ratio)) − 1` from −90° to 90°: the constant that minimises a log-L2 loss (`docs/method.md` §6).
    factors: Vec<f32>,
    /// Mean luminance from −90° to 90°, with each panorama normalised to mean 1: the constant that minimises a squared
    /// error. Missing in older files.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    linear_factors: Option<Vec<f32>>,
}

/// Errors of reading or computing a profile.
#[derive(Debug, thiserror::Error)]
pub enum ProfileError {
    /// The file cannot be read.
    #[error("{}: {source}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// The system's error.
        source: std::io::Error,
    },
    /// The file is not JSON of a profile.
    #[error("not a profile: {0}")]
    Json(#[from] serde_json::Error),
    /// The version of the format is not supported.
    #[error("unsupported profile: format_version is {0}, expected 1")]
    Version(u32),
    /// A factor is out of range.
    #[error("invalid profile: factors must be finite and not negative, at least one")]
    Factors,
    /// A sample cannot be read.
    #[error(transparent)]
    Dataset(#[from] DatasetError),
    /// No sample has a panorama.
    #[error("none of the samples has a panorama")]
    NoPanorama,
    /// The event handler cancelled the computation.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
}

/// Accumulates the profile of many samples.
#[derive(Clone, Debug, Default)]
pub struct ProfileBuilder {
    sums: Vec<BandSums>,
    samples: usize,
}

/// Sums of one band, weighted by solid angle.
#[derive(Clone, Copy, Debug, Default)]
struct BandSums {
    log_ratio: f64,
    linear: f64,
    angle: f64,
}

impl ProfileBuilder {
    /// Adds all panoramas of a sample.
    pub fn add(&mut self, sample: &Sample) {
        let mean = luminance(mean_colour(sample));
        if mean < MIN_LUMINANCE || sample.views.is_empty() {
            return;
        }
        self.samples += 1;
        self.sums.resize(BANDS, BandSums::default());
        let up = sample.up.unwrap_or(Vec3::Y);
        for view in &sample.views {
            let (width, height) = (view.radiance.width(), view.radiance.height());
            let own_mean = mean_luminance(&view.radiance).max(f64::MIN_POSITIVE);
            for y in 0..height {
                let angle = f64::from(lo_geometry::pixel_solid_angle_sr(y, width, height));
                for x in 0..width {
                    let direction = view.rotation * pixel_direction(x, y, width, height);
                    let band = (height_of(direction, up) * BANDS as f32) as usize;
                    let light = f64::from(luminance(view.radiance[(x, y)]).max(0.0));
                    let sums = &mut self.sums[band.min(BANDS - 1)];
                    sums.log_ratio += angle * (light / f64::from(mean)).ln_1p();
                    sums.linear += angle * light / own_mean;
                    sums.angle += angle;
                }
            }
        }
    }

    /// Returns the profile; `None` if no sample had a panorama. Empty bands take the nearest band's value.
    pub fn finish(self, dataset: &str) -> Option<Profile> {
        let covered = |band: &usize| self.sums[*band].angle > 0.0;
        let nearest = |band: usize| (0..self.sums.len()).filter(covered).min_by_key(|other| other.abs_diff(band));
        let bands: Vec<BandSums> = (0..self.sums.len()).filter_map(nearest).map(|band| self.sums[band]).collect();
        let factors: Vec<f32> = bands.iter().map(|sums| (sums.log_ratio / sums.angle).exp_m1() as f32).collect();
        let linear_factors = Some(bands.iter().map(|sums| (sums.linear / sums.angle) as f32).collect());
        let (samples, dataset) = (self.samples, dataset.to_owned());
        (!factors.is_empty()).then_some(Profile { format_version: 1, samples, dataset, factors, linear_factors })
    }
}

impl Profile {
    /// Computes the profile of samples of a dataset; `name` is stored as the dataset's name.
    ///
    /// # Errors
    /// Unreadable samples; no panorama in any sample; cancellation.
    pub fn from_dataset(
        dataset: &dyn Dataset,
        indices: &[usize],
        name: &str,
        on_event: OnEvent<'_>,
    ) -> Result<Self, ProfileError> {
        let mut steps = Steps::begin(on_event, lo_dataset::stages::READ_SAMPLES, indices.len());
        let mut builder = ProfileBuilder::default();
        for &index in indices {
            if steps.cancelled() {
                return Err(Cancelled.into());
            }
            builder.add(&dataset.get(index)?);
            steps.step();
        }
        steps.end();
        builder.finish(name).ok_or(ProfileError::NoPanorama)
    }

    /// Reads a file, see [`Self::from_json`].
    ///
    /// # Errors
    /// Unreadable or invalid files.
    pub fn read(path: &Path) -> Result<Self, ProfileError> {
        let bytes = std::fs::read(path).map_err(|source| ProfileError::Io { path: path.to_owned(), source })?;
        Self::from_json(&bytes)
    }

    /// Parses a profile. An additional field `generator`, the program that wrote it, is ignored.
    ///
    /// # Errors
    /// Invalid or unsupported profiles.
    pub fn from_json(bytes: &[u8]) -> Result<Self, ProfileError> {
        let mut object: serde_json::Value = serde_json::from_slice(bytes)?;
        object.as_object_mut().map(|fields| fields.remove("generator"));
        let profile: Self = serde_json::from_value(object)?;
        if profile.format_version != 1 {
            return Err(ProfileError::Version(profile.format_version));
        }
        let is_wrong = |factors: &Vec<f32>| factors.is_empty() || !factors.iter().all(|v| v.is_finite() && *v >= 0.0);
        if is_wrong(&profile.factors) || profile.linear_factors.as_ref().is_some_and(is_wrong) {
            return Err(ProfileError::Factors);
        }
        Ok(profile)
    }

    /// Returns the factor of the photo's mean luminance in a unit direction, interpolated between bands.
    pub fn at(&self, direction: Vec3, up: Vec3) -> f32 {
        interpolated(&self.factors, direction, up)
    }

    /// Returns the luminance in a unit direction, with a mean of about 1 over the sphere; `None` without linear
    /// factors.
    pub fn linear_at(&self, direction: Vec3, up: Vec3) -> Option<f32> {
        self.linear_factors.as_ref().map(|factors| interpolated(factors, direction, up))
    }

    /// Returns the number of photos averaged.
    pub fn samples(&self) -> usize {
        self.samples
    }
}

/// Interpolates the bands at a unit direction.
fn interpolated(factors: &[f32], direction: Vec3, up: Vec3) -> f32 {
    let last = factors.len() - 1;
    let position = (height_of(direction, up) * factors.len() as f32 - 0.5).clamp(0.0, last as f32);
    let first = position as usize;
    let share = position - first as f32;
    factors[first] * (1.0 - share) + factors[(first + 1).min(last)] * share
}

/// Returns the mean linear colour of a photo. Clipped pixels are used as they are.
pub(crate) fn mean_colour(sample: &Sample) -> [f32; 3] {
    let mut sum = [0.0f64; 3];
    for rgb in sample.photo.pixels() {
        (0..3).for_each(|c| sum[c] += f64::from(linear_from_srgb8(rgb[c])));
    }
    sum.map(|v| (v / sample.photo.pixels().len().max(1) as f64) as f32)
}

/// Returns the elevation from 0, straight down, to 1, straight up.
fn height_of(direction: Vec3, up: Vec3) -> f32 {
    0.5 + direction.dot(up).clamp(-1.0, 1.0).asin() / std::f32::consts::PI
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use lo_imaging::RadianceImage;

    use super::*;
    use crate::testing;
    use lo_dataset::NovelView;
    use lo_geometry::Quat;

    #[test]
    fn a_known_profile_comes_back_however_the_camera_is_turned() {
        let grey = linear_from_srgb8(128);
        let mut builder = ProfileBuilder::default();
        for (angle, factor) in [(0.0, 1.0f32), (0.4, 3.0)] {
            let rotation = Quat::from_rotation_x(angle);
            let mut sample = testing::sample();
            sample.up = Some(rotation * Vec3::Y);
            // Above the horizon 2 or 6 times as bright as the photo, dark below.
            let radiance = RadianceImage::from_fn(128, 64, |_, y| [if y < 32 { 2.0 * factor * grey } else { 0.0 }; 3]);
            sample.views = vec![NovelView { position_m: Vec3::ZERO, rotation, radiance, depth_m: None }];
            builder.add(&sample);
        }
        let profile = builder.finish("test").unwrap();
        // Expected: e^((ln 3 + ln 7) / 2) − 1.
        let expected = 21f32.sqrt() - 1.0;
        let at = |y: f32| profile.at(Vec3::new(0.0, y, 0.7).normalize(), Vec3::Y);
        assert!((at(0.6) - expected).abs() < 1e-3 && at(-0.6) < 1e-6, "{}", at(0.6));
        // The mean of each panorama is half of its upper half's radiance.
        let linear = |y: f32| profile.linear_at(Vec3::new(0.0, y, 0.7).normalize(), Vec3::Y).unwrap();
        assert!((linear(0.6) - 2.0).abs() < 1e-3 && linear(-0.6) < 1e-6, "{}", linear(0.6));
        let copy = Profile::from_json(&serde_json::to_vec(&profile).unwrap()).unwrap();
        assert_eq!((copy.samples(), &copy), (2, &profile));
        assert!(Profile::from_json(b"{\"factors\":[]}").is_err());
        let wrong = serde_json::json!({"format_version": 1, "samples": 1, "dataset": "x", "factors": [-1.0]});
        assert!(Profile::from_json(wrong.to_string().as_bytes()).unwrap_err().to_string().contains("negative"));
        assert!(ProfileBuilder::default().finish("none").is_none());
        let former = serde_json::json!({"format_version": 1, "samples": 1, "dataset": "x", "factors": [1.0]});
        assert_eq!(Profile::from_json(former.to_string().as_bytes()).unwrap().linear_at(Vec3::Y, Vec3::Y), None);
    }
}
