//! Accumulation of the light that rays deposit on a leaf.

use super::rays::RayLight;

/// The part of a ray that ends on a leaf.
pub(super) struct Deposit {
    pub leaf: u32,
    pub column: u32,
    /// Share of the ray that the leaf stops.
    pub weight: f32,
    /// Share of the ray that reaches the leaf.
    pub arriving: f32,
    /// Whether the view is closed at this leaf, which therefore gets the lamps of the ray.
    pub closes: bool,
    /// Whether the leaf is directly behind the one that closes the view.
    pub behind: bool,
}

#[derive(Clone, Copy, Debug, Default)]
/// Sums over the deposits on a leaf; shares of rays are multiplied by the rays' solid angle.
pub(super) struct LeafAccumulator {
    pub weight: f64,
    /// Radiance without lamps, weighted.
    light: [f64; 3],
    /// First and second moments of log luminance, weighted.
    log: f64,
    log_squared: f64,
    /// Weight of the clipped rays.
    pub clipped: f64,
    pub rays: u32,
    /// Radiance of lamps times solid angle, and the solid angle that reaches the leaf.
    lamp: [f64; 3],
    arriving: f64,
    /// Radiance of lamps on rays that the leaf closes, times solid angle.
    pub closing_lamp: [f64; 3],
    /// Brightest lamp of any ray.
    peak: [f32; 3],
}

impl LeafAccumulator {
    pub fn add(&mut self, ray: &RayLight, deposit: &Deposit, solid_angle: f32) {
        let [weight, arriving] = [deposit.weight, deposit.arriving].map(|share| f64::from(share * solid_angle));
        self.weight += weight;
        self.arriving += arriving;
        (0..3).for_each(|c| self.light[c] += weight * f64::from(ray.radiance[c]));
        if deposit.closes || deposit.behind {
            (0..3).for_each(|c| {
                self.lamp[c] += f64::from(solid_angle * ray.lamp[c]);
                self.closing_lamp[c] += if deposit.closes { f64::from(solid_angle * ray.lamp[c]) } else { 0.0 };
                self.peak[c] = self.peak[c].max(ray.lamp[c]);
            });
        }
        let log = f64::from(if deposit.closes { ray.lamp_log } else { ray.log });
        self.log += weight * log;
        self.log_squared += weight * log * log;
        self.clipped += if ray.clipped { weight } else { 0.0 };
        self.rays += 1;
    }

    /// Returns the mean light without lamps, weighted by the share of each ray that the leaf stops.
    pub fn mean(&self) -> Option<[f32; 3]> {
        (self.weight > 0.0).then(|| self.light.map(|sum| (sum / self.weight) as f32))
    }

    /// Returns the lamps' radiance, averaged over the solid angle that reaches the leaf, since that is its visible
    /// part. At most the peak radiance.
    pub fn lamp(&self) -> [f32; 3] {
        let seen = |c: usize| ((self.lamp[c] / self.arriving) as f32).min(self.peak[c]);
        if self.arriving > 0.0 { std::array::from_fn(seen) } else { [0.0; 3] }
    }

    /// Returns the variance of log luminance.
    pub fn variance(&self) -> f64 {
        if self.weight > 0.0 {
            (self.log_squared / self.weight - (self.log / self.weight).powi(2)).max(0.0)
        } else {
            0.0
        }
    }
}
