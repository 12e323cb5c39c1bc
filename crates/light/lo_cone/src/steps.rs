use lo_octree::MAX_DEPTH;

use crate::{SampleWeight, Settings, StepRule};

/// Least growth of the literal rule, which does not advance without growth; below this it would take more than 10⁵
/// samples.
const MIN_LITERAL_GROWTH: f64 = 1e-4;

/// Greatest growth; above it, a cone leaves any cube after its second sample.
const MAX_GROWTH: f64 = 1e6;

/// Upper bound on samples across a cube, for any valid settings.
const MAX_STEPS: usize = 1 << 18;

/// Distances, lengths and levels of the samples of all cones of one aperture, over a range of distances
/// (`docs/method.md` §3.1).
///
/// Lengths are in leaf edges. A sample depends on its number alone: equal steps up to the crossover, geometric steps
/// after it, and equal steps again once they are as long as the coarsest nodes, which longer ones could jump over.
#[derive(Debug)]
pub(crate) struct StepTable {
    growth: f64,
    near: f32,
    far: f32,
    steps: Vec<Step>,
    /// Distance and level (rounded up) of each step, and of a sentinel behind all steps.
    waypoints: Vec<Waypoint>,
    /// For each level, the first step with a coarser level.
    level_ends: [i32; MAX_DEPTH as usize + 1],
    /// First step of each bin of the range, or of a later one; the last bin is behind the last step.
    bins: Vec<i32>,
    bins_per_edge: f32,
}

/// The part of a step that the search for occupied cells needs.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Waypoint {
    pub distance: f32,
    pub level: i32,
}

/// One sample of a cone.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Step {
    /// Distance sₙ from the apex.
    pub distance: f32,
    /// Length δₙ that the sample represents.
    pub length: f32,
    /// Weight wₙ of the radiance.
    pub weight: f32,
    /// log₂ δₙ, clamped to the levels that are sampled.
    pub level: f32,
}

impl StepTable {
    /// Computes the samples of cones with `tan_half_angle` at distances in [`near`, `far`].
    pub fn new(settings: &Settings, tan_half_angle: f32, max_level: u32, near: f32, far: f32) -> Self {
        let growth = growth(settings, tan_half_angle);
        let first = f64::from(settings.first_step);
        let floor = match settings.step {
            StepRule::Literal => 0.0,
            StepRule::Floored(fraction) => f64::from(fraction),
        };
        let bins_per_edge = if floor > 0.0 { 1.0 / floor as f32 } else { 4.0 };
        let mut table = Self {
            growth,
            near,
            far,
            steps: Vec::new(),
            waypoints: Vec::new(),
            level_ends: [0; MAX_DEPTH as usize + 1],
            bins: Vec::new(),
            bins_per_edge,
        };

        // Number and distance of the sample at which the steps begin to grow.
        let equal = if growth * first >= floor { 0.0 } else { (1.0 / growth - first / floor).ceil() };
        let crossover = first + equal * floor;
        let (ln_ratio, log2_ratio) = (growth.ln_1p(), growth.ln_1p() / std::f64::consts::LN_2);
        let first_length_log2 = (crossover * growth).log2();
        // Number and distance of the last sample before the steps reach the greatest length.
        let most = match settings.step {
            StepRule::Literal => f64::INFINITY,
            StepRule::Floored(_) => f64::from(max_level).exp2().max(floor),
        };
        let growing = if growth > 0.0 && most.is_finite() {
            equal + ((most / (crossover * growth)).ln() / ln_ratio).ceil().max(0.0)
        } else {
            f64::INFINITY
        };
        let last_growing = crossover * ((growing - equal) * ln_ratio).exp();
        let mut n = if f64::from(near) <= first {
            0.0
        } else if f64::from(near) <= crossover {
            ((f64::from(near) - first) / floor).ceil()
        } else if f64::from(near) <= last_growing {
            equal + ((f64::from(near) / crossover).ln() / ln_ratio).ceil()
        } else {
            growing + ((f64::from(near) - last_growing) / most).ceil()
        };
        while table.steps.len() < MAX_STEPS {
            let (distance, length, log2_length) = if n == 0.0 {
                (first, first, first.log2())
            } else if n <= equal {
                (first + n * floor, floor, floor.log2())
            } else if n > growing {
                (last_growing + (n - growing) * most, most, most.log2())
            } else {
                let distance = crossover * ((n - equal) * ln_ratio).exp();
                let log2_length = first_length_log2 + (n - equal - 1.0) * log2_ratio;
                (distance, distance * growth / (1.0 + growth), log2_length)
            };
            if distance >= f64::from(far) {
                break;
            }
            let weight = match settings.weight {
                SampleWeight::One => 1.0,
                SampleWeight::Paper => (length / distance) as f32,
            };
            let level = log2_length.clamp(0.0, f64::from(max_level)) as f32;
            table.push(Step { distance: distance as f32, length: length as f32, weight, level });
            n += 1.0;
        }
        table.finish();
        table
    }

    /// Returns whether the table contains all samples in [`near`, `far`] of cones with `tan_half_angle`.
    pub fn covers(&self, settings: &Settings, tan_half_angle: f32, near: f32, far: f32) -> bool {
        self.growth == growth(settings, tan_half_angle) && self.near <= near && self.far >= far
    }

    pub fn steps(&self) -> &[Step] {
        &self.steps
    }

    /// Returns the first step at or beyond `distance`.
    pub fn first_at(&self, distance: f32) -> i32 {
        let mut step = self.bins[self.bin(distance)];
        while self.waypoints[step as usize].distance < distance {
            step += 1;
        }
        step
    }

    /// Returns a step not behind the first one at or beyond `distance`; with the floored rule, exactly that one.
    #[inline(always)]
    #[expect(unsafe_code)]
    pub fn about_first_at(&self, distance: f32) -> i32 {
        // SAFETY: `bin` returns an index of `bins`.
        let step = unsafe { *self.bins.get_unchecked(self.bin(distance)) };
        step + i32::from(self.waypoint(step).distance < distance)
    }

    /// Returns distance and level of a step, or of the sentinel behind the last.
    #[inline(always)]
    #[expect(unsafe_code)]
    pub fn waypoint(&self, step: i32) -> Waypoint {
        debug_assert!((0..self.waypoints.len() as i32).contains(&step));
        // SAFETY: all steps that this type returns are at most the number of steps, and there is one waypoint more than
        // that. Steps that `march` increments are below an end that was returned.
        unsafe { *self.waypoints.get_unchecked(step as usize) }
    }

    /// Returns the first step whose level is above `level`.
    #[inline(always)]
    #[expect(unsafe_code)]
    pub fn level_end(&self, level: i32) -> i32 {
        debug_assert!((0..self.level_ends.len() as i32).contains(&level));
        // SAFETY: no octree is deeper, so no level is higher.
        unsafe { *self.level_ends.get_unchecked(level as usize) }
    }

    #[inline(always)]
    #[expect(unsafe_code)]
    fn bin(&self, distance: f32) -> usize {
        let bin = (distance - self.near) * self.bins_per_edge;
        let bin = bin.max(0.0).min((self.bins.len() - 1) as f32);
        // SAFETY: between 0 and the number of bins; `max` turned NaN into 0.
        unsafe { bin.to_int_unchecked::<i32>() as usize }
    }

    fn push(&mut self, step: Step) {
        self.waypoints.push(Waypoint { distance: step.distance, level: rounded_up(step.level) });
        self.steps.push(step);
    }

    fn finish(&mut self) {
        let count = self.steps.len() as i32;
        for (level, end) in self.level_ends.iter_mut().enumerate() {
            // The first sample can be coarser than those after it: nothing is skipped from there.
            let last = self.waypoints.iter().rposition(|waypoint| waypoint.level <= level as i32);
            *end = last.map_or(0, |last| last as i32 + 1);
        }
        self.waypoints.push(Waypoint { distance: f32::INFINITY, level: 0 });
        // The same rounding here and in the search, so that no step is missed.
        let length = self.steps.last().map_or(0.0, |step| (step.distance - self.near) * self.bins_per_edge);
        self.bins = vec![count; length as usize + 2];
        for step in (0..count).rev() {
            let bin = self.bin(self.steps[step as usize].distance);
            self.bins[bin] = step;
        }
        for bin in (1..self.bins.len()).rev() {
            self.bins[bin - 1] = self.bins[bin - 1].min(self.bins[bin]);
        }
    }
}

/// Computes ⌈level⌉; `f32::ceil` is a call without SSE 4.1.
#[inline(always)]
pub(crate) fn rounded_up(level: f32) -> i32 {
    let floor = level as i32;
    floor + i32::from((floor as f32) < level)
}

/// Computes k = c · tan θ.
fn growth(settings: &Settings, tan_half_angle: f32) -> f64 {
    let growth = f64::from(settings.growth) * f64::from(tan_half_angle.max(0.0));
    let least = match settings.step {
        StepRule::Literal => MIN_LITERAL_GROWTH,
        StepRule::Floored(_) => 0.0,
    };
    growth.clamp(least, MAX_GROWTH)
}
