//! Errors of depth maps.

use lo_imaging::DepthMap;
use serde::Serialize;

/// Errors of an estimated depth map ẑ against the true one, z, over the pixels where both have a reading.
///
/// Definitions follow Eigen et al. 2014, without scale alignment.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct DepthErrors {
    /// Mean of |ẑ − z| / z.
    pub abs_rel: f64,
    /// `abs_rel` after scaling ẑ by the median of z / ẑ: the error of the shape alone.
    pub scaled_abs_rel: f64,
    /// Median of ẑ / z: below 1 if the scene is estimated too near and too small.
    pub scale: f64,
    /// `scaled_abs_rel` of a constant depth, the median of z.
    pub constant_abs_rel: f64,
    /// √ mean (ẑ − z)², metres.
    pub rmse_m: f64,
    /// Shares of pixels with max(ẑ / z, z / ẑ) below 1.25, 1.25² and 1.25³.
    pub delta: [f64; 3],
    /// Number of pixels compared.
    pub pixels: usize,
}

impl DepthErrors {
    /// Compares two maps of one view; the truth is resampled to the estimate's resolution.
    ///
    /// `None` if no pixel has a reading in both.
    pub fn compare(truth_m: &DepthMap, got_m: &DepthMap) -> Option<Self> {
        let truth_m = lo_imaging::resize_depth(truth_m, got_m.width(), got_m.height());
        let reading = |z: f32| z.is_finite() && z > 0.0;
        let pairs = truth_m.pixels().iter().zip(got_m.pixels()).filter(|&(&z, &got)| reading(z) && reading(got));
        let pairs: Vec<(f64, f64)> = pairs.map(|(&z, &got)| (f64::from(z), f64::from(got))).collect();
        let pixels = pairs.len();
        if pixels == 0 {
            return None;
        }
        let larger = median(pairs.iter().map(|(z, got)| z / got));
        let middle = median(pairs.iter().map(|(z, _)| *z));
        let mut sums = [0.0f64; 7];
        for (z, got) in pairs {
            let ratio = (got / z).max(z / got);
            let within = [1, 2, 3].map(|power| f64::from(u8::from(ratio < 1.25f64.powi(power))));
            let relative = [got, larger * got, middle].map(|got| (got - z).abs() / z);
            let terms = relative.into_iter().chain([(got - z).powi(2)]).chain(within);
            sums.iter_mut().zip(terms).for_each(|(sum, term)| *sum += term);
        }
        let [abs_rel, scaled_abs_rel, constant_abs_rel, squared, d1, d2, d3] = sums.map(|sum| sum / pixels as f64);
        let (scale, rmse_m) = (1.0 / larger, squared.sqrt());
        Some(Self { abs_rel, scaled_abs_rel, scale, constant_abs_rel, rmse_m, delta: [d1, d2, d3], pixels })
    }
}

/// Returns the median; of an even number of values, the upper of the two in the middle.
fn median(values: impl Iterator<Item = f64>) -> f64 {
    let mut values: Vec<f64> = values.collect();
    let middle = values.len() / 2;
    *values.select_nth_unstable_by(middle, f64::total_cmp).1
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn closed_forms() {
        let truth = DepthMap::new(5, 1, vec![1.0, 2.0, 4.0, 0.0, 1.0]);
        let got = DepthMap::new(5, 1, vec![1.2, 1.0, 4.0, 3.0, 0.0]);
        let errors = DepthErrors::compare(&truth, &got).unwrap();
        assert_eq!(errors.pixels, 3, "the last two lack a reading in one map");
        assert!((errors.abs_rel - (0.2 + 0.5) / 3.0).abs() < 1e-7);
        assert!((errors.rmse_m - ((0.04 + 1.0) / 3.0f64).sqrt()).abs() < 1e-7);
        // Ratios z / ẑ of 0.83, 2 and 1: the middle one is 1. The median of 1, 2 and 4 m is 2 m.
        assert!((errors.scaled_abs_rel - (0.2 + 0.5) / 3.0).abs() < 1e-7);
        assert!((errors.constant_abs_rel - (1.0 + 0.0 + 0.5) / 3.0).abs() < 1e-7);
        let twice = DepthErrors::compare(&truth, &got.map(|z| 2.0 * z)).unwrap();
        assert!((twice.scaled_abs_rel - errors.scaled_abs_rel).abs() < 1e-6 && twice.abs_rel > 0.7);
        assert!((errors.scale - 1.0).abs() < 1e-7 && (twice.scale - 2.0).abs() < 1e-6);
        // ratios 1.2, 2 and 1; 1.25³ is 1.953
        assert_eq!(errors.delta, [2.0 / 3.0; 3]);
        assert_eq!(DepthErrors::compare(&truth, &DepthMap::new(5, 1, vec![0.0; 5])), None);
    }
}
