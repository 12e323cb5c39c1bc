//! Robust statistics for fits with outliers.

/// Median of numbers that may be infinite, the mean of the middle two for an even count; NaN if empty. Reorders
/// `values`.
pub(crate) fn median(values: &mut [f64]) -> f64 {
    if values.is_empty() {
        return f64::NAN;
    }
    let (even, half) = (values.len().is_multiple_of(2), values.len() / 2);
    let (below, &mut upper, _) = values.select_nth_unstable_by(half, f64::total_cmp);
    let lower = below.iter().copied().max_by(f64::total_cmp).filter(|&lower| even && lower != upper);
    lower.map_or(upper, |lower| 0.5 * (lower + upper))
}

/// Tukey's biweight of an error, given the standard deviation `scale`: 1 at zero, 0 from 4.685 deviations on.
pub(crate) fn tukey(error: f64, scale: f64) -> f64 {
    // Exact data have a deviation of 0.
    let share = error / (4.685 * scale.max(1e-9));
    if share.abs() < 1.0 { (1.0 - share * share).powi(2) } else { 0.0 }
}

/// The pair of `candidates` that most of the samples `0..samples` agree with, and the largest error of an agreeing
/// sample.
///
/// The least median of squares (Rousseeuw) sets the scale. The sum of squared errors, each clamped to 2.5 deviations,
/// decides, so that the other samples count even where one wall fills more than half of the photo. `None` if no
/// candidate has a finite median.
pub(crate) fn most_agreed(
    candidates: &[(f64, f64)],
    samples: usize,
    error: impl Fn((f64, f64), usize) -> f64,
) -> Option<((f64, f64), f64)> {
    let errors = |candidate| (0..samples).map(|sample| error(candidate, sample).abs()).collect::<Vec<_>>();
    let least = candidates
        .iter()
        .map(|&candidate| median(&mut errors(candidate)))
        .filter(|error| error.is_finite())
        .min_by(f64::total_cmp)?;
    // Exact data have only the error of f32.
    let most = 2.5 * 1.4826 * least.max(1e-4);
    let cost = |candidate| errors(candidate).iter().map(|error| error.min(most).powi(2)).sum::<f64>();
    let costs = candidates.iter().map(|&candidate| (cost(candidate), candidate));
    costs.min_by(|one, other| one.0.total_cmp(&other.0)).map(|(_, candidate)| (candidate, most))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn medians() {
        assert!(median(&mut []).is_nan());
        assert_eq!(median(&mut [3.0]), 3.0);
        assert_eq!(median(&mut [5.0, 1.0]), 3.0);
        assert_eq!(median(&mut [9.0, f64::INFINITY, 1.0]), 9.0);
        assert_eq!(median(&mut [f64::INFINITY, 1.0, f64::INFINITY, f64::INFINITY]), f64::INFINITY);
        assert_eq!(median(&mut [4.0, 1.0, 3.0, 2.0]), 2.5);
    }

    #[test]
    fn a_majority_that_fits_any_line_does_not_decide_alone() {
        // Three of five samples at one point on all lines, one on the line y = 2 x + 1, one outlier.
        let samples = [(0.0, 1.0), (0.0, 1.0), (0.0, 1.0), (1.0, 3.0), (2.0, -9.0)];
        let lines = [(0.0, 1.0), (2.0, 1.0), (-1.0, 1.0), (2.0, f64::INFINITY)];
        let error = |(a, b): (f64, f64), sample: usize| a * samples[sample].0 + b - samples[sample].1;
        assert_eq!(most_agreed(&lines, 5, error).map(|(line, _)| line), Some((2.0, 1.0)));
        assert_eq!(most_agreed(&lines[3..], 5, error), None);
        assert_eq!(most_agreed(&[], 5, error), None);
    }

    #[test]
    fn biweight_ends_where_tukey_says() {
        assert_eq!(tukey(0.0, 2.0), 1.0);
        assert_eq!(tukey(9.37, 2.0), 0.0);
        assert_eq!(tukey(f64::INFINITY, 2.0), 0.0);
        // (1 − 1/4)² halfway.
        assert!((tukey(4.685, 2.0) - 0.5625).abs() < 1e-12);
    }
}
