//! Errors of depth maps.

use lo_imaging::DepthMap;
use serde::Serialize;

/// Errors of an estimated depth map over the pixels where both maps have a reading (Eigen et al. 2014, without aligning scales).
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct DepthErrors {
    /// Mean of |ẑ − z| / z.
    pub abs_rel: f64,
    /// √ mean (ẑ − z)², metres.
    pub rmse_m: f64,
    /// Shares of pixels with max(ẑ / z, z / ẑ) below 1.25, 1.25² and 1.25³.
    pub delta: [f64; 3],
    /// Pixels that count.
    pub pixels: usize,
}

impl DepthErrors {
    /// Compares maps of the same view; the truth is resampled to the estimate's resolution. `None` where no pixel has both.
    pub fn of(truth_m: &DepthMap, got_m: &DepthMap) -> Option<Self> {
        let truth_m = lo_imaging::resize_depth(truth_m, got_m.width(), got_m.height());
        let reading = |z: f32| z.is_finite() && z > 0.0;
        let pairs = truth_m.pixels().iter().zip(got_m.pixels()).filter(|&(&z, &got)| reading(z) && reading(got));
        let mut sums = [0.0f64; 5];
        let mut pixels = 0;
        for (z, got) in pairs.map(|(&z, &got)| (f64::from(z), f64::from(got))) {
            let ratio = (got / z).max(z / got);
            let within = [1, 2, 3].map(|power| f64::from(u8::from(ratio < 1.25f64.powi(power))));
            let terms = [(got - z).abs() / z, (got - z).powi(2), within[0], within[1], within[2]];
            sums.iter_mut().zip(terms).for_each(|(sum, term)| *sum += term);
            pixels += 1;
        }
        let [abs_rel, squared, d1, d2, d3] = sums.map(|sum| sum / pixels as f64);
        (pixels > 0).then(|| Self { abs_rel, rmse_m: squared.sqrt(), delta: [d1, d2, d3], pixels })
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn closed_forms() {
        let truth = DepthMap::new(5, 1, vec![1.0, 2.0, 4.0, 0.0, 1.0]);
        let got = DepthMap::new(5, 1, vec![1.2, 1.0, 4.0, 3.0, 0.0]);
        let errors = DepthErrors::of(&truth, &got).unwrap();
        assert_eq!(errors.pixels, 3, "the last two lack a reading");
        assert!((errors.abs_rel - (0.2 + 0.5) / 3.0).abs() < 1e-7);
        assert!((errors.rmse_m - ((0.04 + 1.0) / 3.0f64).sqrt()).abs() < 1e-7);
        // ratios 1.2, 2 and 1; 1.25³ is 1.953
        assert_eq!(errors.delta, [2.0 / 3.0; 3]);
        assert_eq!(DepthErrors::of(&truth, &DepthMap::new(5, 1, vec![0.0; 5])), None);
    }
}
