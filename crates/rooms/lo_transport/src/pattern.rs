//! Sample patterns: low-discrepancy sequences and fixed random rotations.

use lo_geometry::Vec2;
use lo_random::RngExt;

/// Returns the radical inverse in base 3, in [0, 1).
pub(crate) fn radical_inverse_3(mut i: u32) -> f32 {
    let (mut value, mut digit) = (0.0, 1.0 / 3.0);
    while i > 0 {
        value += (i % 3) as f32 * digit;
        digit /= 3.0;
        i /= 3;
    }
    value
}

/// Returns point `i` of the R2 sequence (Roberts 2018), based on powers of the plastic number.
pub(crate) fn r2(i: u32) -> Vec2 {
    // Integer arithmetic in units of 2⁻³² keeps full precision for every `i`.
    let at = |step: u32| (i.wrapping_mul(step) >> 8) as f32 / (1 << 24) as f32;
    Vec2::new(at(3_242_174_889), at(2_447_445_414))
}

/// Fixed random numbers that shift or rotate a pattern per item, so that neighbours do not share one.
pub(crate) struct Rotations {
    values: Vec<[f32; 4]>,
}

impl Rotations {
    const COUNT: usize = 4096;

    pub(crate) fn new(name: &str, seed: u64) -> Self {
        let mut stream = lo_random::stream(seed, name, 0);
        Self { values: (0..Self::COUNT).map(|_| std::array::from_fn(|_| stream.random())).collect() }
    }

    /// Returns four numbers in [0, 1) for item `i`.
    pub(crate) fn of(&self, i: usize) -> [f32; 4] {
        self.values[i % Self::COUNT]
    }
}

/// Returns `x + shift`, wrapped into [0, 1).
pub(crate) fn shifted(x: f32, shift: f32) -> f32 {
    let sum = x + shift;
    (if sum >= 1.0 { sum - 1.0 } else { sum }).min(1.0 - f32::EPSILON)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn radical_inverse_by_hand() {
        let thirds = [0, 1, 2, 3, 5].map(radical_inverse_3);
        let expected = [0.0, 1.0 / 3.0, 2.0 / 3.0, 1.0 / 9.0, 2.0 / 3.0 + 1.0 / 9.0];
        assert!(thirds.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-6));
    }

    #[test]
    fn r2_fills_the_square_evenly() {
        // Every cell of a 16 × 16 grid gets its share of 4096 points, 16, within a few.
        let mut counts = [0; 256];
        for i in 0..4096 {
            let p = r2(i);
            counts[(p.x * 16.0) as usize * 16 + (p.y * 16.0) as usize] += 1;
        }
        assert!(counts.iter().all(|c| (12..=20).contains(c)), "{counts:?}");
    }
}
