//! Statistics of a dataset: counts and distributions.

use std::collections::{BTreeSet, HashMap};

use lo_imaging::{DepthMap, RadianceImage, luminance};
use serde::Serialize;
use serde_json::Value;

use crate::{Sample, Split};

/// Collects statistics of samples.
#[derive(Clone, Debug, Default)]
pub struct Summary {
    samples: [usize; 3],
    scenes: [BTreeSet<String>; 3],
    views: usize,
    points: usize,
    luminance: Bins,
    depth: Bins,
    figures: HashMap<&'static str, Vec<f32>>,
}

/// Statistics of a [`Summary`]. Light is in units of the photo's white.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SummaryReport {
    /// Number of photos.
    pub samples: usize,
    /// Number of rooms.
    pub scenes: usize,
    /// Number of photos for training, validation and test.
    pub samples_by_split: [usize; 3],
    /// Number of rooms for training, validation and test.
    pub scenes_by_split: [usize; 3],
    /// Number of panoramas.
    pub views: usize,
    /// Number of surface points.
    pub points: usize,
    /// Luminance of all panoramas, weighted by solid angle, or of the photos' radiance if there are none. One stop per
    /// bin.
    pub log2_luminance: Histogram,
    /// Depth of the photos' pixels, half a metre per bin. Pixels without depth are excluded.
    pub depth_m: Histogram,
    /// Distributions of per-sample figures.
    pub figures: Vec<Distribution>,
}

/// Histogram with equal bins.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Histogram {
    /// Lower bound of the first bin.
    pub first: f32,
    /// Width of a bin.
    pub step: f32,
    /// Share of each bin. Values out of range count in the first and last bin.
    pub shares: Vec<f32>,
}

/// Distribution of a figure over the samples that have it.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Distribution {
    /// Name of the figure, with its unit.
    pub name: &'static str,
    /// Number of samples that have it.
    pub count: usize,
    /// Mean value.
    pub mean: f32,
    /// The 5th, 25th, 50th, 75th and 95th percentiles.
    pub percentiles: [f32; 5],
}

#[derive(Clone, Debug, Default)]
struct Bins(Vec<f64>);

const LUMINANCE_BINS: usize = 32;
const FIRST_LOG2: f32 = -14.0;
const DEPTH_BINS: usize = 24;
const DEPTH_STEP_M: f32 = 0.5;

impl Bins {
    fn add(&mut self, bins: usize, position: f32, weight: f64) {
        self.0.resize(bins, 0.0);
        self.0[(position.max(0.0) as usize).min(bins - 1)] += weight;
    }

    fn histogram(&self, first: f32, step: f32) -> Histogram {
        let total: f64 = self.0.iter().sum();
        Histogram { first, step, shares: self.0.iter().map(|weight| (weight / total) as f32).collect() }
    }
}

impl Summary {
    /// Adds a sample of this split of its dataset.
    pub fn add(&mut self, sample: &Sample, split: Split) {
        let part = match split {
            Split::Train => 0,
            Split::Validation => 1,
            Split::Test => 2,
        };
        self.samples[part] += 1;
        self.scenes[part].insert(sample.scene_id.clone());
        self.views += sample.views.len();
        self.points += sample.points.len();
        let maps: Vec<&RadianceImage> = sample.views.iter().map(|view| &view.radiance).collect();
        for map in &maps {
            self.add_luminance(map, true);
        }
        if let (true, Some(radiance)) = (maps.is_empty(), &sample.radiance) {
            self.add_luminance(radiance, false);
        }
        if let Some(map) = maps.first() {
            self.figure("contrast of a panorama, stops", contrast_stops(map));
        }
        if let Some(depth) = &sample.depth_m {
            depth.pixels().iter().filter(|&&z| z > 0.0).for_each(|z| self.depth.add(DEPTH_BINS, z / DEPTH_STEP_M, 1.0));
            self.figure("median depth, m", median_depth(depth));
        }
        if let Some(depth) = &sample.sensor_depth_m {
            let holes = depth.pixels().iter().filter(|&&z| z == 0.0).count() as f32 / depth.pixels().len() as f32;
            self.figure("pixels without sensor depth, share", holes);
        }
        if let Some(albedo) = &sample.albedo {
            let sum: f64 = albedo.pixels().iter().map(|&rgb| f64::from(luminance(rgb))).sum();
            self.figure("mean albedo", (sum / albedo.pixels().len() as f64) as f32);
        }
        let clipped = sample.photo.pixels().iter().filter(|rgb| rgb.contains(&255)).count();
        self.figure("clipped pixels, share", clipped as f32 / sample.photo.pixels().len() as f32);
        self.figure("horizontal field of view, degrees", sample.camera.hfov_deg() as f32);
        let room = |key: &str| sample.metadata.get("room").and_then(|room| room.get(key)).and_then(Value::as_f64);
        for (key, name) in [("lamps_on", "lamps switched on"), ("window_share", "window area, share of the floor's")] {
            if let Some(value) = room(key) {
                self.figure(name, value as f32);
            }
        }
    }

    fn add_luminance(&mut self, map: &RadianceImage, sphere: bool) {
        for y in 0..map.height() {
            let weight =
                if sphere { f64::from(lo_geometry::pixel_solid_angle_sr(y, map.width(), map.height())) } else { 1.0 };
            for x in 0..map.width() {
                self.luminance.add(LUMINANCE_BINS, luminance(map[(x, y)]).log2() - FIRST_LOG2, weight);
            }
        }
    }

    /// Adds a figure computed by the caller.
    pub fn figure(&mut self, name: &'static str, value: f32) {
        self.figures.entry(name).or_default().push(value);
    }

    /// Returns the statistics of all samples so far.
    pub fn report(&self) -> SummaryReport {
        let mut figures: Vec<Distribution> =
            self.figures.iter().map(|(name, values)| distribution(name, values)).collect();
        figures.sort_by_key(|figure| figure.name);
        let scenes_by_split = self.scenes.each_ref().map(BTreeSet::len);
        SummaryReport {
            samples: self.samples.iter().sum(),
            scenes: scenes_by_split.iter().sum(),
            samples_by_split: self.samples,
            scenes_by_split,
            views: self.views,
            points: self.points,
            log2_luminance: self.luminance.histogram(FIRST_LOG2, 1.0),
            depth_m: self.depth.histogram(0.0, DEPTH_STEP_M),
            figures,
        }
    }
}

fn distribution(name: &'static str, values: &[f32]) -> Distribution {
    let mut sorted = values.to_vec();
    sorted.sort_unstable_by(f32::total_cmp);
    let at = |share: f32| sorted[((sorted.len() - 1) as f32 * share).round() as usize];
    Distribution {
        name,
        count: values.len(),
        mean: values.iter().sum::<f32>() / values.len() as f32,
        percentiles: [0.05, 0.25, 0.5, 0.75, 0.95].map(at),
    }
}

/// Returns the stops between the brightest thousandth of the sphere's pixels and their median.
fn contrast_stops(map: &RadianceImage) -> f32 {
    let mut light: Vec<f32> = map.pixels().iter().map(|&rgb| luminance(rgb)).collect();
    light.sort_unstable_by(f32::total_cmp);
    let at = |share: f32| light[((light.len() - 1) as f32 * share) as usize].max(1e-9);
    (at(0.999) / at(0.5)).log2()
}

fn median_depth(depth: &DepthMap) -> f32 {
    let mut readings: Vec<f32> = depth.pixels().iter().copied().filter(|&z| z > 0.0).collect();
    readings.sort_unstable_by(f32::total_cmp);
    readings.get(readings.len() / 2).copied().unwrap_or(0.0)
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::fixture::record;

    #[test]
    fn figures_of_a_known_sample() {
        let mut summary = Summary::default();
        let mut sample = record("a").sample(0);
        // The upper half of the sphere is 2⁰·⁵, the lower 2⁻³·⁵, and one pixel 2¹⁰.
        let view = &mut sample.views[0].radiance;
        let (width, height) = (view.width(), view.height());
        for y in 0..height {
            for x in 0..width {
                view[(x, y)] = [if y < height / 2 { 0.5f32.exp2() } else { (-3.5f32).exp2() }; 3];
            }
        }
        view[(3, 4)] = [1024.0; 3];
        summary.add(&sample, Split::Train);
        let other = Sample { scene_id: "other".into(), views: Vec::new(), radiance: None, ..sample.clone() };
        summary.add(&other, Split::Test);
        let report = summary.report();
        assert_eq!((report.samples, report.scenes, report.views, report.points), (2, 2, 1, 40));
        assert_eq!((report.samples_by_split, report.scenes_by_split), ([1, 0, 1], [1, 0, 1]));
        let bin = |log2: f32| report.log2_luminance.shares[(log2 - FIRST_LOG2) as usize];
        assert!((bin(0.5) - 0.5).abs() < 1e-5 && bin(-3.5) > 0.45 && bin(10.0) > 0.0 && bin(10.0) < 0.02);
        assert!((report.depth_m.shares.iter().sum::<f32>() - 1.0).abs() < 1e-5);
        let figure = |name: &str| report.figures.iter().find(|f| f.name.starts_with(name)).unwrap();
        assert!((figure("mean albedo").mean - 0.265).abs() < 1e-6, "half of 0.5, half of 0.03");
        assert!((figure("horizontal").percentiles[2] - 70.0).abs() < 1e-3);
        // One column of six.
        assert!((figure("pixels without").mean - 1.0 / 6.0).abs() < 1e-6);
        // The median is between the halves. The brightest thousandth of 128 pixels excludes the single bright one.
        assert!(figure("contrast").mean <= 4.1);
    }
}
