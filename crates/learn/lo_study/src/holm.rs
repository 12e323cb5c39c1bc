//! Correction for several tests.

/// Returns the adjusted p-values of Holm (1979), in the order given.
///
/// Rejecting all that are below a level keeps the probability of any false rejection below that level, whatever the
/// dependence between the tests.
pub fn holm(p_values: &[f64]) -> Vec<f64> {
    let mut order: Vec<usize> = (0..p_values.len()).collect();
    order.sort_by(|&a, &b| p_values[a].total_cmp(&p_values[b]));
    let mut adjusted = vec![0.0; p_values.len()];
    let mut largest = 0.0_f64;
    for (rank, &index) in order.iter().enumerate() {
        largest = largest.max((p_values.len() - rank) as f64 * p_values[index]).min(1.0);
        adjusted[index] = largest;
    }
    adjusted
}

#[cfg(test)]
mod tests {
    use super::*;

    fn assert_adjusted(p_values: &[f64], expected: &[f64]) {
        let found = holm(p_values);
        let is_near = |(a, b): (&f64, &f64)| (a - b).abs() < 1e-15;
        assert!(found.len() == expected.len() && found.iter().zip(expected).all(is_near), "{found:?}");
    }

    #[test]
    fn adjusted_values_are_those_computed_by_hand() {
        // Sorted 0.005, 0.01, 0.03, 0.04, times 4, 3, 2, 1: 0.02, 0.03, 0.06, 0.04; the last rises to 0.06.
        assert_adjusted(&[0.01, 0.04, 0.03, 0.005], &[0.03, 0.06, 0.06, 0.02]);
        // 0.9 times 2 is cut to 1, and so is what follows.
        assert_adjusted(&[0.95, 0.9], &[1.0, 1.0]);
        assert_adjusted(&[0.2, 0.2, 0.2], &[0.6, 0.6, 0.6]);
    }

    #[test]
    fn one_test_needs_no_correction() {
        assert_adjusted(&[0.03], &[0.03]);
        assert_adjusted(&[], &[]);
    }
}
