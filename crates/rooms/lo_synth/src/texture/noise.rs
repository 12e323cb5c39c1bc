/// Tileable value noise: random values on a lattice, smoothly interpolated.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Noise {
    seed: u32,
}

impl Noise {
    pub(crate) fn new(seed: u64) -> Self {
        Self { seed: (seed ^ (seed >> 32)) as u32 }
    }

    /// Returns an independent noise, derived from this one.
    pub(crate) fn derived(self, number: u32) -> Self {
        Self { seed: self.seed.wrapping_add(number.wrapping_mul(0x9e37_79b9)) }
    }

    /// Value at a lattice point, uniform in [0, 1).
    pub(crate) fn at(self, x: i32, y: i32) -> f32 {
        self.hashed(column(x), row(y))
    }

    /// Hashes a [`column`] and a [`row`] with an integer finaliser in the style of MurmurHash3.
    #[inline(always)]
    fn hashed(self, column: u32, row: u32) -> f32 {
        let mut h = self.seed ^ column ^ row;
        h ^= h >> 16;
        h = h.wrapping_mul(0x7feb_352d);
        h ^= h >> 15;
        h = h.wrapping_mul(0x846c_a68b);
        h ^= h >> 16;
        (h >> 8) as f32 / (1 << 24) as f32
    }

    /// Interpolated noise in [0, 1] with mean ½. The unit square of `(u, v)` holds `cells` lattice cells and repeats.
    pub(crate) fn smooth(self, u: f32, v: f32, cells: [i32; 2]) -> f32 {
        let (x, y) = (u * cells[0] as f32, v * cells[1] as f32);
        let (x0, y0) = (floor(x), floor(y));
        let ease = |t: f32| t * t * (3.0 - 2.0 * t);
        let (fx, fy) = (ease(x - x0 as f32), ease(y - y0 as f32));
        let (x0, y0) = (wrap(x0, cells[0]), wrap(y0, cells[1]));
        let (x0, x1) = (column(x0), column(wrap(x0 + 1, cells[0])));
        let (y0, y1) = (row(y0), row(wrap(y0 + 1, cells[1])));
        let (a, b) = (self.hashed(x0, y0), self.hashed(x1, y0));
        let (c, d) = (self.hashed(x0, y1), self.hashed(x1, y1));
        let top = a + (b - a) * fx;
        top + (c + (d - c) * fx - top) * fy
    }

    /// Sum of octaves of halving amplitude, in [0, 1] with mean ½.
    pub(crate) fn octaves(self, u: f32, v: f32, cells: [i32; 2], octaves: u32) -> f32 {
        let (mut sum, mut weight, mut total) = (0.0, 1.0, 0.0);
        for octave in 0..octaves {
            let fine = cells.map(|c| c << octave);
            sum += weight * self.derived(octave).smooth(u, v, fine);
            total += weight;
            weight *= 0.5;
        }
        sum / total
    }
}

fn column(x: i32) -> u32 {
    (x as u32).wrapping_mul(0x85eb_ca6b)
}

fn row(y: i32) -> u32 {
    (y as u32).wrapping_mul(0xc2b2_ae35)
}

/// Floor as an integer. Without SSE 4.1, `f32::floor` is a function call.
fn floor(x: f32) -> i32 {
    let toward_zero = x as i32;
    toward_zero - i32::from(toward_zero as f32 > x)
}

/// `i` modulo `n`. Skips the costly division in the common case of `i` in range.
fn wrap(i: i32, n: i32) -> i32 {
    if (0..n).contains(&i) { i } else { i.rem_euclid(n) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn whole_parts_are_those_of_the_standard_library() {
        for x in [0.0, 0.99, 1.0, 7.5, -0.01, -1.0, -1.5, -63.999, 8e6] {
            assert_eq!(floor(x), f32::floor(x) as i32, "{x}");
        }
        assert_eq!([-1, 0, 7, 8, 17, -9].map(|i| wrap(i, 8)), [7, 0, 7, 0, 1, 7]);
    }

    #[test]
    fn noise_repeats_and_has_the_mean_of_its_range() {
        let noise = Noise::new(5);
        let mut sum = 0.0;
        for k in 0..10_000 {
            let (u, v) = ((k % 100) as f32 / 100.0, (k / 100) as f32 / 100.0);
            let value = noise.octaves(u, v, [8, 4], 3);
            assert!((0.0..=1.0).contains(&value));
            assert!((value - noise.octaves(u + 1.0, v - 2.0, [8, 4], 3)).abs() < 1e-3, "it repeats");
            sum += value / 10_000.0;
        }
        // About 200 independent values with a standard deviation of 0.2 each.
        assert!((sum - 0.5).abs() < 0.06, "{sum}");
    }
}
