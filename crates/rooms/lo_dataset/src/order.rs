//! Shuffled order without a table: a loader's position is two numbers, however large the dataset.

use lo_random::RngExt;

/// Rounds of the Feistel network. Four make a pseudo-random permutation (Luby & Rackoff 1988); more are cheap.
const ROUNDS: usize = 8;

/// Pseudo-random permutation of `0..count`: a Feistel network on the next even number of bits, iterated until the
/// result is in range (cycle walking; Black & Rogaway, "Ciphers with Arbitrary Finite Domains", 2002). At most four
/// iterations are needed on average.
#[derive(Clone, Debug)]
pub(crate) struct Permutation {
    count: u64,
    half_bits: u32,
    keys: [u64; ROUNDS],
}

impl Permutation {
    pub fn new(count: u64, seed: u64, epoch: u64) -> Self {
        let bits = u64::BITS - count.saturating_sub(1).leading_zeros();
        let mut stream = lo_random::stream(seed, "order", epoch);
        Self { count, half_bits: bits.div_ceil(2).max(1), keys: [(); ROUNDS].map(|()| stream.random()) }
    }

    /// Returns the element at `position`, which must be below the count.
    pub fn at(&self, position: u64) -> u64 {
        debug_assert!(position < self.count);
        let mut value = position;
        loop {
            value = self.encrypt(value);
            if value < self.count {
                return value;
            }
        }
    }

    fn encrypt(&self, value: u64) -> u64 {
        let mask = u64::MAX >> (u64::BITS - self.half_bits);
        let (mut left, mut right) = (value >> self.half_bits, value & mask);
        for key in self.keys {
            (left, right) = (right, left ^ (mix(right ^ key) & mask));
        }
        (left << self.half_bits) | right
    }
}

/// Finaliser of SplitMix64 (Steele, Lea & Flood 2014).
fn mix(mut x: u64) -> u64 {
    x = (x ^ (x >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    x = (x ^ (x >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    x ^ (x >> 31)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_element_stands_somewhere_once() {
        for count in [1, 2, 3, 10, 63, 64, 65, 1000, 4096] {
            let permutation = Permutation::new(count, 3, 1);
            let mut seen: Vec<u64> = (0..count).map(|i| permutation.at(i)).collect();
            seen.sort_unstable();
            assert!(seen.iter().copied().eq(0..count), "{count}");
        }
    }

    #[test]
    fn places_are_uniform_over_epochs() {
        // χ² of the position of element 0: 10 positions, 4,000 epochs. With 9 degrees of freedom, 27.9 is exceeded once
        // in a thousand.
        let mut counts = [0.0f64; 10];
        for epoch in 0..4000 {
            let permutation = Permutation::new(10, 7, epoch);
            let place = (0..10).position(|i| permutation.at(i) == 0);
            counts[place.unwrap_or(0)] += 1.0;
        }
        let chi2: f64 = counts.iter().map(|c| (c - 400.0).powi(2) / 400.0).sum();
        assert!(chi2 < 27.9, "{chi2}: {counts:?}");
    }

    #[test]
    fn huge_sets_need_no_table() {
        let permutation = Permutation::new(1 << 50, 1, 0);
        assert!(permutation.at(0) < 1 << 50 && permutation.at(0) != permutation.at(1));
    }
}
