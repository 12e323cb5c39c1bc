//! Exact inference for a binomial proportion.

/// Returns the two-sided p-value of the exact binomial test against probability ½.
///
/// The distribution is symmetric, so that this is twice the smaller tail, at most 1: the sum over all outcomes that are
/// no more probable than the observed one. 1 without trials.
///
/// # Panics
/// If there are more successes than trials.
pub fn exact_p_value(successes: u64, trials: u64) -> f64 {
    assert!(successes <= trials, "{successes} successes in {trials} trials");
    let fewer = successes.min(trials - successes);
    (2.0 * lower_tail(fewer, trials, 0.5)).min(1.0)
}

/// Returns the confidence interval of Clopper and Pearson (1934) for the probability of success.
///
/// Its coverage is at least `confidence`. [0, 1] without trials.
///
/// # Panics
/// If there are more successes than trials.
pub fn exact_interval(successes: u64, trials: u64, confidence: f64) -> [f64; 2] {
    assert!(successes <= trials, "{successes} successes in {trials} trials");
    let tail = 0.5 * (1.0 - confidence);
    // P(X ≤ k; p) decreases with p.
    let upper_bound = |successes: u64| {
        if successes == trials { 1.0 } else { bisect(|p| lower_tail(successes, trials, p) > tail) }
    };
    // P(X ≥ k; p) = P(X ≤ n − k; 1 − p).
    [1.0 - upper_bound(trials - successes), upper_bound(successes)]
}

/// Returns P(X ≤ k) of n trials with probability p, strictly between 0 and 1.
fn lower_tail(k: u64, n: u64, p: f64) -> f64 {
    let (ln_p, ln_q) = (p.ln(), (-p).ln_1p());
    let (mut ln_choose, mut sum) = (0.0, 0.0);
    for i in 0..=k {
        if i > 0 {
            ln_choose += ((n - i + 1) as f64 / i as f64).ln();
        }
        sum += (ln_choose + i as f64 * ln_p + (n - i) as f64 * ln_q).exp();
    }
    sum.min(1.0)
}

/// Returns the end in [0, 1] of the interval from 0 on which a condition holds.
fn bisect(holds: impl Fn(f64) -> bool) -> f64 {
    let (mut low, mut high) = (0.0, 1.0);
    for _ in 0..f64::MANTISSA_DIGITS {
        let middle = 0.5 * (low + high);
        if holds(middle) { low = middle } else { high = middle }
    }
    0.5 * (low + high)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn assert_near(found: f64, expected: f64) {
        // Rounding of sums of exponentials, relative.
        assert!((found - expected).abs() <= 1e-11 * expected, "{found:e} instead of {expected:e}");
    }

    #[test]
    fn p_values_are_those_of_pascals_triangle() {
        assert_near(exact_p_value(10, 10), 2.0 / 1024.0);
        assert_near(exact_p_value(0, 10), 2.0 / 1024.0);
        assert_near(exact_p_value(9, 10), 22.0 / 1024.0);
        assert_near(exact_p_value(8, 10), 112.0 / 1024.0);
        assert_near(exact_p_value(1, 3), 1.0);
        assert_near(exact_p_value(60, 60), 2.0 / 2_f64.powi(60));
    }

    #[test]
    fn no_preference_and_no_answers_have_p_1() {
        for trials in [0, 2, 10, 400] {
            assert_eq!(exact_p_value(trials / 2, trials), 1.0, "{trials}");
        }
    }

    #[test]
    fn p_values_are_symmetric_and_fall_with_the_distance_from_half() {
        for trials in [7, 24, 1001] {
            let p: Vec<f64> = (0..=trials).map(|successes| exact_p_value(successes, trials)).collect();
            assert!((0..p.len()).all(|i| p[i] == p[p.len() - 1 - i]), "{trials}");
            assert!(p[..p.len() / 2].windows(2).all(|pair| pair[0] <= pair[1]), "{trials}");
        }
    }

    #[test]
    fn many_trials_approach_the_normal_distribution() {
        // z = 1499.5 / 500 = 2.999 with the correction of continuity, and 2 Φ(−2.999) = 0.0027087.
        let p = exact_p_value(501_500, 1_000_000);
        assert!((p / 0.002_708_7 - 1.0).abs() < 1e-3, "{p}");
    }

    #[test]
    fn intervals_have_their_closed_forms_at_the_ends() {
        // P(X ≥ n) = pⁿ and P(X ≤ 0) = (1 − p)ⁿ.
        for trials in [1_u64, 10, 75] {
            let end = 0.025_f64.powf(1.0 / trials as f64);
            let [low, high] = exact_interval(trials, trials, 0.95);
            assert!((low - end).abs() < 1e-12 && high == 1.0, "{low} {end}");
            let [low, high] = exact_interval(0, trials, 0.95);
            assert!(low == 0.0 && (high - (1.0 - end)).abs() < 1e-12, "{high} {end}");
        }
        assert_eq!(exact_interval(0, 0, 0.95), [0.0, 1.0]);
        // Clopper and Pearson: one success in two trials, P(X ≤ 1) = 1 − p².
        let [low, high] = exact_interval(1, 2, 0.95);
        assert!((high - 0.975_f64.sqrt()).abs() < 1e-12 && (low - (1.0 - 0.975_f64.sqrt())).abs() < 1e-12);
    }

    #[test]
    fn an_interval_excludes_chance_where_the_test_rejects_it() {
        for successes in 0..=30 {
            let [low, high] = exact_interval(successes, 30, 0.95);
            assert_eq!(low > 0.5 || high < 0.5, exact_p_value(successes, 30) < 0.05, "{successes}");
        }
    }
}
