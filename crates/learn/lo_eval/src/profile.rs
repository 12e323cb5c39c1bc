//! The mean vertical profile of a dataset's panoramas: how bright it is at which height, compared with the photo.

use std::path::{Path, PathBuf};

use lo_dataset::{Dataset, DatasetError, Sample};
use lo_events::{Cancelled, OnEvent, Stage, Steps};
use lo_geometry::{Vec3, pixel_direction};
use lo_imaging::{RadianceImage, linear_from_srgb8, luminance};
use lo_metrics::solid_angles_sr;
use serde::{Deserialize, Serialize};

/// Bands of equal height in elevation, from straight down to straight up.
const BANDS: usize = 32;
/// PhotoSelection darker than this say nothing about ratios.
const MIN_LUMINANCE: f32 = 1e-3;

/// Luminance of panoramas over the mean luminance of their photos, for bands of elevation.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Profile {
    /// 1.
    format_version: u32,
    /// PhotoSelection that it is the mean of.
    samples: usize,
    /// What their dataset calls itself.
    dataset: String,
    /// From −90° to 90°: `exp(mean ln(1 + ratio)) − 1`, the constant that a log-L2 loss (`docs/method.md` §6) would choose.
    factors: Vec<f32>,
    /// From −90° to 90°: mean luminance where each panorama's own mean is 1, the constant that a squared error would
    /// choose. Files of former versions lack it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    linear_factors: Option<Vec<f32>>,
}

/// Why there is no profile.
#[derive(Debug, thiserror::Error)]
pub enum ProfileError {
    /// The file cannot be read.
    #[error("{}: {source}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// What the system says.
        source: std::io::Error,
    },
    /// Not the JSON that is written.
    #[error("no profile: {0}")]
    Json(#[from] serde_json::Error),
    /// Of another version of the format.
    #[error("no profile: format_version is {0}, not 1")]
    Version(u32),
    /// Values out of range.
    #[error("no profile: factors must be finite and not negative")]
    Factors,
    /// A sample cannot be read.
    #[error(transparent)]
    Dataset(#[from] DatasetError),
    /// No sample has a panorama.
    #[error("no panorama in these samples")]
    NoPanorama,
    /// The handler asked for the end.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
}

/// Adds up the profiles of many samples.
#[derive(Clone, Debug, Default)]
pub struct ProfileBuilder {
    sums: Vec<BandSums>,
    samples: usize,
}

/// Sums over one band, weighted by solid angle.
#[derive(Clone, Copy, Debug, Default)]
struct BandSums {
    log_ratio: f64,
    linear: f64,
    angle: f64,
}

impl ProfileBuilder {
    /// Takes in all panoramas of a sample.
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
            let own_mean = mean_luminance(&view.radiance);
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

    /// The profile; `None` where no sample had a panorama. Bands that small panoramas left out take their neighbour's value.
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
    /// The profile of these samples of a dataset, which is called `name` in it.
    ///
    /// # Errors
    /// Samples that cannot be read or have no panorama; a handler that asks for the end.
    pub fn of(
        dataset: &dyn Dataset,
        indices: &[usize],
        name: &str,
        on_event: OnEvent<'_>,
    ) -> Result<Self, ProfileError> {
        let mut steps = Steps::begin(on_event, Stage::ReadSamples, indices.len());
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

    /// Reads a file of [`Self::from_json`].
    ///
    /// # Errors
    /// A file that cannot be read or is no profile.
    pub fn read(path: &Path) -> Result<Self, ProfileError> {
        let bytes = std::fs::read(path).map_err(|source| ProfileError::Io { path: path.to_owned(), source })?;
        Self::from_json(&bytes)
    }

    /// Reads what was written with serde; a `generator`, the program that wrote it, may stand beside.
    ///
    /// # Errors
    /// Says what is wrong with it.
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

    /// Factor of the photo's mean luminance in a unit direction, between the bands' middles by interpolation.
    pub fn at(&self, direction: Vec3, up: Vec3) -> f32 {
        interpolated(&self.factors, direction, up)
    }

    /// Luminance in a unit direction, whose mean over the sphere is about 1; `None` where the file has no linear
    /// profile.
    pub fn linear_at(&self, direction: Vec3, up: Vec3) -> Option<f32> {
        self.linear_factors.as_ref().map(|factors| interpolated(factors, direction, up))
    }

    /// PhotoSelection that it is the mean of.
    pub fn samples(&self) -> usize {
        self.samples
    }
}

/// Value of bands of elevation in a unit direction.
fn interpolated(factors: &[f32], direction: Vec3, up: Vec3) -> f32 {
    let last = factors.len() - 1;
    let position = (height_of(direction, up) * factors.len() as f32 - 0.5).clamp(0.0, last as f32);
    let first = position as usize;
    let share = position - first as f32;
    factors[first] * (1.0 - share) + factors[(first + 1).min(last)] * share
}

/// Mean luminance of a panorama over the sphere, above 0.
fn mean_luminance(panorama: &RadianceImage) -> f64 {
    let angles = solid_angles_sr(panorama.width(), panorama.height());
    let weighted = panorama.pixels().iter().zip(&angles).map(|(&rgb, &angle)| luminance(rgb).max(0.0) * angle);
    weighted.map(f64::from).sum::<f64>().max(f64::MIN_POSITIVE) / angles.iter().map(|v| f64::from(*v)).sum::<f64>()
}

/// Mean colour of a photo in linear light, clipped as the photo is.
pub(crate) fn mean_colour(sample: &Sample) -> [f32; 3] {
    let mut sum = [0.0f64; 3];
    for rgb in sample.photo.pixels() {
        (0..3).for_each(|c| sum[c] += f64::from(linear_from_srgb8(rgb[c])));
    }
    sum.map(|v| (v / sample.photo.pixels().len().max(1) as f64) as f32)
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
        // A panorama's own mean is half of its upper half.
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
