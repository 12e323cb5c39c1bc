/// Gradient-free lattice noise that repeats: values on a grid, smoothly interpolated.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Noise {
    seed: u32,
}

impl Noise {
    pub(crate) fn new(seed: u64) -> Self {
        Self { seed: (seed ^ (seed >> 32)) as u32 }
    }

    /// Another noise of the same family.
    pub(crate) fn other(self, number: u32) -> Self {
        Self { seed: self.seed.wrapping_add(number.wrapping_mul(0x9e37_79b9)) }
    }

    /// Uniform in [0, 1) at a lattice point (finaliser of MurmurHash3).
    pub(crate) fn at(self, x: i32, y: i32) -> f32 {
        let mut h = self.seed ^ (x as u32).wrapping_mul(0x85eb_ca6b) ^ (y as u32).wrapping_mul(0xc2b2_ae35);
        h ^= h >> 16;
        h = h.wrapping_mul(0x7feb_352d);
        h ^= h >> 15;
        h = h.wrapping_mul(0x846c_a68b);
        h ^= h >> 16;
        (h >> 8) as f32 / (1 << 24) as f32
    }

    /// In [0, 1], mean ½; `(u, v)` in [0, 1]² holds `cells` lattice cells and repeats.
    pub(crate) fn smooth(self, u: f32, v: f32, cells: [i32; 2]) -> f32 {
        let (x, y) = (u * cells[0] as f32, v * cells[1] as f32);
        let (x0, y0) = (x.floor(), y.floor());
        let ease = |t: f32| t * t * (3.0 - 2.0 * t);
        let (fx, fy) = (ease(x - x0), ease(y - y0));
        let value =
            |dx: i32, dy: i32| self.at((x0 as i32 + dx).rem_euclid(cells[0]), (y0 as i32 + dy).rem_euclid(cells[1]));
        let (a, b) = (value(0, 0), value(1, 0));
        let (c, d) = (value(0, 1), value(1, 1));
        let top = a + (b - a) * fx;
        top + (c + (d - c) * fx - top) * fy
    }

    /// Octaves of halving strength, in [0, 1], mean ½.
    pub(crate) fn octaves(self, u: f32, v: f32, cells: [i32; 2], octaves: u32) -> f32 {
        let (mut sum, mut weight, mut total) = (0.0, 1.0, 0.0);
        for octave in 0..octaves {
            let fine = cells.map(|c| c << octave);
            sum += weight * self.other(octave).smooth(u, v, fine);
            total += weight;
            weight *= 0.5;
        }
        sum / total
    }
}
