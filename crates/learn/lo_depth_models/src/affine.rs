//! Relative depth to metres: a robust fit to metric depth of the same photo.
//!
//! Networks for relative depth predict an affine function of inverse depth, `1 / z = a · d + b` (Ranftl et al.,
//! "MiDaS", TPAMI 2020), or the logarithm of depth up to an offset. The unknowns are fitted to metric depth that may be
//! coarse and partly wrong: errors are ratios of depths, and up to half of the pixels may be outliers.

use lo_imaging::{DepthMap, Image};

use crate::robust::{median, most_agreed, tukey};

/// Two depths agree if their ratio is at most this: the threshold of the metric δ₁.
const AGREES: f64 = 1.25;
/// Pixels sampled along each side.
const SAMPLES: usize = 64;
/// Fewest pixels for a fit.
const MIN_COUNT: usize = 64;
/// Smallest share of agreeing pixels for a fit.
const MIN_AGREE: f64 = 0.4;
/// Largest error of a fit, as a share of the error of one constant depth.
const MAX_ERROR_LEFT: f64 = 0.9;

/// Coefficients that convert relative depth to metres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Fit {
    /// `a` of `1 / z = a · d + b`; 1 if `d` is the logarithm.
    pub a: f64,
    /// `b` of `1 / z = a · d + b` or of `ln z = d + b`.
    pub b: f64,
    /// Share of the pixels whose depths agree within a ratio of 1.25.
    pub agree: f64,
    /// Median ratio of the depths, minus one.
    pub error: f64,
}

/// Errors of fitting relative depth to metric depth.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum FitError {
    /// Too few pixels have both depths.
    #[error("only {0} of the sampled pixels have a depth of both kinds")]
    TooFew(usize),
    /// The model's output is constant.
    #[error("relative depth is the same at every pixel")]
    Constant,
    /// The model's output increases with distance.
    #[error("its values increase with distance, but those of inverse depth must decrease")]
    Falls,
    /// One constant depth would fit as well.
    #[error("it fits the built-in network's depth no better than a constant depth")]
    Unrelated,
    /// The depths do not agree.
    #[error("it does not fit the built-in network's depth: {:.0} % of the pixels agree within 25 %", 100.0 * .agree)]
    Poor {
        /// Share of the pixels whose depths agree within a ratio of 1.25.
        agree: f64,
    },
}

/// Fits `1 / z = a · d + b` to `metric_m` (0: no reading). It shows the same view and may have another size.
///
/// # Errors
/// Too few readings, a constant `inverse`, a negative `a`, a poor fit.
pub fn fit_inverse(inverse: &Image<f32>, metric_m: &DepthMap) -> Result<Fit, FitError> {
    let samples = samples(inverse, metric_m)?;
    // Normalised to median 0 and spread 1, since `d` may have any unit.
    let middle = median(&mut samples.iter().map(|&(d, _)| d).collect::<Vec<_>>());
    let spread = median(&mut samples.iter().map(|&(d, _)| (d - middle).abs()).collect::<Vec<_>>());
    let spread =
        if spread > 0.0 { spread } else { samples.iter().map(|&(d, _)| (d - middle).abs()).fold(0.0, f64::max) };
    if !(spread > 1e-6 * middle.abs() && spread.is_finite()) {
        return Err(FitError::Constant);
    }
    let samples: Vec<_> = samples.iter().map(|&(d, z)| ((d - middle) / spread, z)).collect();
    let (a, b) = refined(&samples, line_of_most(&samples)?);
    if a <= 0.0 {
        return Err(FitError::Falls);
    }
    let (agree, error) = quality(samples.iter().map(|&(d, z)| log_ratio(a, b, d, z)));
    check(agree, error, &samples)?;
    Ok(Fit { a: a / spread, b: b - a * middle / spread, agree, error })
}

/// Fits `ln z = d + b` to `metric_m` (0: no reading). It shows the same view and may have another size.
///
/// # Errors
/// Too few readings, a poor fit.
pub fn fit_log(log: &Image<f32>, metric_m: &DepthMap) -> Result<Fit, FitError> {
    let samples = samples(log, metric_m)?;
    let b = median(&mut samples.iter().map(|&(d, z)| z.ln() - d).collect::<Vec<_>>());
    let (agree, error) = quality(samples.iter().map(|&(d, z)| z.ln() - d - b));
    check(agree, error, &samples)?;
    Ok(Fit { a: 1.0, b, agree, error })
}

/// Converts to metres by a fit of [`fit_inverse`]; 0 where the inverse depth is not finite or not positive.
pub fn metres_of_inverse(inverse: &Image<f32>, fit: &Fit) -> DepthMap {
    inverse.map(|&d| {
        let inverse_m = fit.a * f64::from(d) + fit.b;
        reading((inverse_m > 0.0).then(|| inverse_m.recip()))
    })
}

/// Converts to metres by a fit of [`fit_log`]; 0 where the value is not finite.
pub fn metres_of_log(log: &Image<f32>, fit: &Fit) -> DepthMap {
    log.map(|&d| reading(Some((f64::from(d) + fit.b).exp())))
}

fn reading(metres: Option<f64>) -> f32 {
    metres.map(|metres| metres as f32).filter(|metres| metres.is_finite() && *metres > 0.0).unwrap_or(0.0)
}

/// Pairs of the model's value and metres, on a regular grid.
fn samples(relative: &Image<f32>, metric_m: &DepthMap) -> Result<Vec<(f64, f64)>, FitError> {
    let (columns, rows) = (relative.width().min(SAMPLES), relative.height().min(SAMPLES));
    let at = |image: &Image<f32>, column: usize, row: usize| {
        let x = (2 * column + 1) * image.width() / (2 * columns);
        let y = (2 * row + 1) * image.height() / (2 * rows);
        image.pixels().get(y * image.width() + x).copied().map_or(f64::NAN, f64::from)
    };
    let samples: Vec<_> = (0..rows)
        .flat_map(|row| (0..columns).map(move |column| (column, row)))
        .map(|(column, row)| (at(relative, column, row), at(metric_m, column, row)))
        .filter(|(d, z)| d.is_finite() && z.is_finite() && *z > 0.0)
        .collect();
    if samples.len() < MIN_COUNT { Err(FitError::TooFew(samples.len())) } else { Ok(samples) }
}

/// Logarithm of metric over fitted depth; infinite where the fitted inverse depth is not positive.
fn log_ratio(a: f64, b: f64, d: f64, z: f64) -> f64 {
    let inverse_m = a * d + b;
    if inverse_m > 0.0 { (z * inverse_m).ln() } else { f64::INFINITY }
}

/// The line that most samples agree with, among lines through a sample of the nearer and one of the farther half.
fn line_of_most(samples: &[(f64, f64)]) -> Result<(f64, f64), FitError> {
    let mut sorted = samples.to_vec();
    sorted.sort_by(|one, other| one.0.total_cmp(&other.0));
    let half = sorted.len() / 2;
    let every = |count: usize, most: usize| (0..count).step_by(count.div_ceil(most).max(1));
    let judges: Vec<_> = every(samples.len(), 512).map(|index| samples[index]).collect();
    let through = |index: usize| {
        let ((d0, z0), (d1, z1)) = (sorted[index], sorted[index + half]);
        let a = (z1.recip() - z0.recip()) / (d1 - d0);
        (a, z0.recip() - a * d0)
    };
    let lines: Vec<_> = every(half, 400).map(through).filter(|(a, b)| a.is_finite() && b.is_finite()).collect();
    let agreed = most_agreed(&lines, judges.len(), |(a, b), judge| log_ratio(a, b, judges[judge].0, judges[judge].1));
    agreed.map(|(line, _)| line).ok_or(FitError::Constant)
}

/// Gauss–Newton on the weighted squares of the log ratios.
fn refined(samples: &[(f64, f64)], (mut a, mut b): (f64, f64)) -> (f64, f64) {
    for _ in 0..30 {
        let errors: Vec<_> = samples.iter().map(|&(d, z)| log_ratio(a, b, d, z)).collect();
        let scale = 1.4826 * median(&mut errors.iter().map(|error| error.abs()).collect::<Vec<_>>());
        let [mut aa, mut ab, mut bb, mut ea, mut eb] = [0.0; 5];
        for (&(d, _), &error) in samples.iter().zip(&errors) {
            let weight = tukey(error, scale);
            if weight == 0.0 {
                continue;
            }
            let inverse_m = a * d + b;
            let (by_a, by_b) = (d / inverse_m, inverse_m.recip());
            aa += weight * by_a * by_a;
            ab += weight * by_a * by_b;
            bb += weight * by_b * by_b;
            ea += weight * by_a * error;
            eb += weight * by_b * error;
        }
        let determinant = aa * bb - ab * ab;
        if determinant <= 1e-12 * aa * bb {
            break;
        }
        let (da, db) = ((ab * eb - bb * ea) / determinant, (ab * ea - aa * eb) / determinant);
        (a, b) = (a + da, b + db);
        if da.abs() + db.abs() < 1e-10 * (a.abs() + b.abs()) {
            break;
        }
    }
    (a, b)
}

/// Share of log ratios that agree, and the median ratio minus one.
fn quality(log_ratios: impl Iterator<Item = f64>) -> (f64, f64) {
    let mut errors: Vec<_> = log_ratios.map(f64::abs).collect();
    let near = errors.iter().filter(|&&error| error < AGREES.ln()).count();
    (near as f64 / errors.len().max(1) as f64, median(&mut errors).exp_m1())
}

/// Rejects a fit that is no better than a constant depth, or that too few samples agree with.
fn check(agree: f64, error: f64, samples: &[(f64, f64)]) -> Result<(), FitError> {
    let middle = median(&mut samples.iter().map(|&(_, z)| z.ln()).collect::<Vec<_>>());
    let (_, of_one_depth) = quality(samples.iter().map(|&(_, z)| z.ln() - middle));
    // Where all depths are nearly equal, a constant depth is right.
    let explains = error <= MAX_ERROR_LEFT * of_one_depth || of_one_depth < 0.05;
    match (agree >= MIN_AGREE, explains) {
        (true, true) => Ok(()),
        (true, false) => Err(FitError::Unrelated),
        (false, _) => Err(FitError::Poor { agree }),
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use proptest::prelude::*;

    /// A number of 0 to 1 for each pixel, from a Weyl sequence.
    fn dice(index: usize, stream: f64) -> f64 {
        (index as f64 * 0.618_033_988_749_895 + stream * index as f64 * 0.324_717_957_244_746).fract()
    }

    /// A slanted floor with a box on it, 1 to 6 metres.
    fn depth() -> DepthMap {
        DepthMap::from_fn(120, 90, |x, y| {
            let floor = 6.0 / (1.0 + 5.0 * y as f32 / 90.0);
            if (30..70).contains(&x) && (20..60).contains(&y) { 0.7 * floor } else { floor }
        })
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(32))]
        #[test]
        fn scale_and_offset_are_found_through_noise_and_outliers(a in 0.001..10.0f64, b in -0.1..0.3f64, unit in 0.01..1000.0f64) {
            let truth = depth();
            let relative = truth.map(|&z| ((1.0 / f64::from(z) - b) / a * unit) as f32);
            // 40 % are anywhere between 0.2 and 10 m, the others up to 5 % off.
            let mut index = 0;
            let rough = truth.map(|&z| {
                index += 1;
                if dice(index, 0.0) < 0.4 { (0.2 + 9.8 * dice(index, 1.0)) as f32 } else { z * (1.0 + 0.1 * (dice(index, 2.0) as f32 - 0.5)) }
            });
            let fit = fit_inverse(&relative, &rough).unwrap();
            let metres = metres_of_inverse(&relative, &fit);
            for (&z, &made) in truth.pixels().iter().zip(metres.pixels()) {
                // The noise of 1,500 samples leaves 0.1 %; outliers close to the truth add several times that.
                prop_assert!((made / z - 1.0).abs() < 0.02, "{made} of {z}, {fit:?}");
            }
            prop_assert!((0.6..0.75).contains(&fit.agree), "{fit:?}");
        }

        #[test]
        fn exact_depth_is_exact(a in 0.001..10.0f64, b in -0.1..0.3f64) {
            let truth = depth();
            let relative = truth.map(|&z| ((1.0 / f64::from(z) - b) / a) as f32);
            let small = lo_imaging::resize_depth(&truth, 60, 45);
            prop_assert!(fit_inverse(&relative, &small).unwrap().agree > 0.9);
            let fit = fit_inverse(&relative, &truth).unwrap();
            // Precision of f32: the offset may be many times the spread.
            prop_assert!((fit.a / a - 1.0).abs() < 1e-4 && (fit.b - b).abs() < 1e-5, "{fit:?}");
            prop_assert!(fit.agree == 1.0 && fit.error < 1e-5);
        }
    }

    #[test]
    fn depth_in_place_of_its_inverse_is_an_error() {
        assert_eq!(fit_inverse(&depth(), &depth()), Err(FitError::Falls));
    }

    #[test]
    fn what_has_nothing_to_do_with_depth_is_an_error() {
        let mut index = 0;
        let noise = depth().map(|_| {
            index += 1;
            dice(index, 1.0) as f32
        });
        assert!(matches!(
            fit_inverse(&noise, &depth()),
            Err(FitError::Poor { .. } | FitError::Unrelated | FitError::Falls)
        ));
        assert!(matches!(fit_log(&noise.map(|d| 5.0 * d), &depth()), Err(FitError::Poor { .. } | FitError::Unrelated)));
        let constant = depth().map(|_| 3.0);
        assert_eq!(fit_inverse(&constant, &depth()), Err(FitError::Constant));
        let nothing = depth().map(|_| f32::NAN);
        assert_eq!(fit_inverse(&nothing, &depth()), Err(FitError::TooFew(0)));
        assert_eq!(fit_inverse(&depth(), &depth().map(|_| 0.0)), Err(FitError::TooFew(0)));
        assert_eq!(fit_log(&Image::new(0, 0, Vec::new()), &depth()), Err(FitError::TooFew(0)));
    }

    #[test]
    fn what_should_be_positive_and_is_not_is_no_reading() {
        let fit = Fit { a: 2.0, b: -1.0, agree: 1.0, error: 0.0 };
        let inverse = Image::new(6, 1, vec![0.75, 0.5, 0.1, f32::NAN, f32::INFINITY, f32::NEG_INFINITY]);
        assert_eq!(metres_of_inverse(&inverse, &fit).pixels(), [2.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
        assert_eq!(metres_of_log(&Image::new(2, 1, vec![f32::NAN, 1.0]), &fit).pixels(), [0.0, 1.0]);
    }

    #[test]
    fn logarithms_miss_a_summand() {
        let log = depth().map(|z| z.ln() - 0.7);
        let mut index = 0;
        let rough = depth().map(|&z| {
            index += 1;
            if dice(index, 1.0) < 0.4 { 9.0 } else { z }
        });
        let fit = fit_log(&log, &rough).unwrap();
        let (made, truth) = (metres_of_log(&log, &fit), depth());
        // The median of two fifths that are all too far is off by none: three fifths are exact and below it.
        assert!(made.pixels().iter().zip(truth.pixels()).all(|(made, z)| (made / z - 1.0).abs() < 1e-5), "{fit:?}");
    }
}
