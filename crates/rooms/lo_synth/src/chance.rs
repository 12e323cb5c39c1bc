//! Random draws from a stream.

use lo_random::{RngExt, Stream};

/// Draws uniformly from `[low, high]`.
pub(crate) fn between(random: &mut Stream, low: f32, high: f32) -> f32 {
    low + (high - low) * random.random::<f32>()
}

/// Returns true with the given probability.
pub(crate) fn chance(random: &mut Stream, probability: f32) -> bool {
    random.random::<f32>() < probability
}

/// Draws an integer uniformly from `low ..= high`.
pub(crate) fn count(random: &mut Stream, low: usize, high: usize) -> usize {
    random.random_range(low..=high)
}

/// Draws one of the values with equal probability. The list must not be empty.
pub(crate) fn pick<T: Copy>(random: &mut Stream, values: &[T]) -> T {
    values[random.random_range(0..values.len())]
}

/// Draws one of the values by weight. At least one weight must be positive.
pub(crate) fn weighted<T: Copy>(random: &mut Stream, values: &[(T, f32)]) -> T {
    let total: f32 = values.iter().map(|v| v.1.max(0.0)).sum();
    let mut left = random.random::<f32>() * total;
    for &(value, weight) in values {
        left -= weight.max(0.0);
        if left < 0.0 {
            return value;
        }
    }
    // Rounding can exhaust the loop without a hit.
    values.iter().rev().find(|v| v.1 > 0.0).unwrap_or(&values[values.len() - 1]).0
}

/// Returns the values in random order.
pub(crate) fn shuffled<T>(random: &mut Stream, mut values: Vec<T>) -> Vec<T> {
    use lo_random::seq::SliceRandom;
    values.shuffle(random);
    values
}

/// Linear RGB from hue in degrees, saturation in [0, 1] and luminance `albedo`, with every channel at most 0.88.
pub(crate) fn tone(hue_deg: f32, saturation: f32, albedo: f32) -> [f32; 3] {
    let pure: [f32; 3] = std::array::from_fn(|c| {
        let distance = ((hue_deg / 60.0 - 2.0 * c as f32 + 3.0).rem_euclid(6.0) - 3.0).abs();
        (2.0 - distance).clamp(0.0, 1.0)
    });
    let mixed = pure.map(|p| 1.0 - saturation + saturation * p * p);
    let scale = albedo / lo_imaging::luminance(mixed).max(0.01);
    let max = mixed.iter().copied().fold(0.0, f32::max) * scale;
    let limit = if max > 0.88 { 0.88 / max } else { 1.0 };
    mixed.map(|m| (m * scale * limit).max(0.005))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn weights_are_shares() {
        let mut random = lo_random::stream(1, "weights", 0);
        let mut counts = [0; 3];
        for _ in 0..6000 {
            counts[weighted(&mut random, &[(0, 1.0), (1, 0.0), (2, 2.0)])] += 1;
        }
        // The standard deviation of a share of 1/3 in 6000 draws is 37.
        assert!((counts[0] - 2000_i32).abs() < 150 && counts[1] == 0, "{counts:?}");
    }

    #[test]
    fn tones_have_their_hue_and_albedo() {
        let red = tone(0.0, 0.8, 0.1);
        assert!(red[0] > red[1] && (red[1] - red[2]).abs() < 1e-6);
        let blue = tone(240.0, 0.5, 0.2);
        assert!(blue[2] > blue[0]);
        assert!((lo_imaging::luminance(blue) - 0.2).abs() < 1e-5);
        // The channel limit applies to luminances that a pure yellow cannot reach.
        assert!(tone(60.0, 1.0, 2.0).iter().all(|&c| c <= 0.8801));
    }
}
