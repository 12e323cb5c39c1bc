use crate::{SampleWeight, Settings, StepRule};

/// The literal rule does not advance without growth; with less than this it would take more than 10⁵ samples.
const MIN_LITERAL_GROWTH: f64 = 1e-4;

/// Above this a cone has left any cube after its second sample.
const MAX_GROWTH: f64 = 1e6;

/// More samples than any valid settings give across a cube.
const MAX_STEPS: usize = 1 << 18;

/// Distances, lengths and levels of the samples of all cones of one aperture, over a range of distances (SPEC §3).
///
/// Lengths are in leaf edges. A sample depends on its number alone: equal steps up to the crossover, geometric after it.
#[derive(Debug)]
pub(crate) struct StepTable {
    growth: f64,
    near: f32,
    far: f32,
    steps: Vec<Step>,
    /// For each level the first step with a coarser one.
    level_ends: Vec<u32>,
    /// First step of each bin of the range, or of a later one.
    bins: Vec<u32>,
    bins_per_edge: f32,
}

/// One sample of a cone.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Step {
    /// Distance from the apex, sₙ.
    pub distance: f32,
    /// Length that the sample stands for, δₙ.
    pub length: f32,
    /// Weight of its radiance, wₙ.
    pub weight: f32,
    /// log₂ δₙ, clamped to the levels that are sampled.
    pub level: f32,
}

impl StepTable {
    /// The samples of cones with `tan_half_angle` at distances in [`near`, `far`].
    pub fn new(settings: &Settings, tan_half_angle: f32, max_level: u32, near: f32, far: f32) -> Self {
        let growth = growth(settings, tan_half_angle);
        let first = f64::from(settings.first_step);
        let floor = match settings.step {
            StepRule::Literal => 0.0,
            StepRule::Floored(fraction) => f64::from(fraction),
        };
        let bins_per_edge = if floor > 0.0 { 1.0 / floor as f32 } else { 4.0 };
        let mut table =
            Self { growth, near, far, steps: Vec::new(), level_ends: Vec::new(), bins: Vec::new(), bins_per_edge };

        // Number and distance of the sample from which on the steps grow.
        let equal = if growth * first >= floor { 0.0 } else { (1.0 / growth - first / floor).ceil() };
        let crossover = first + equal * floor;
        let (ln_ratio, log2_ratio) = (growth.ln_1p(), growth.ln_1p() / std::f64::consts::LN_2);
        let first_length_log2 = (crossover * growth).log2();
        let mut n = if f64::from(near) <= first {
            0.0
        } else if f64::from(near) <= crossover {
            ((f64::from(near) - first) / floor).ceil()
        } else {
            equal + ((f64::from(near) / crossover).ln() / ln_ratio).ceil()
        };
        while table.steps.len() < MAX_STEPS {
            let (distance, length, log2_length) = if n == 0.0 {
                (first, first, first.log2())
            } else if n <= equal {
                (first + n * floor, floor, floor.log2())
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
        table.finish(max_level);
        table
    }

    /// Whether cones of `tan_half_angle` find all their samples in [`near`, `far`] here.
    pub fn covers(&self, settings: &Settings, tan_half_angle: f32, near: f32, far: f32) -> bool {
        self.growth == growth(settings, tan_half_angle) && self.near <= near && self.far >= far
    }

    pub fn steps(&self) -> &[Step] {
        &self.steps
    }

    /// First step at or beyond `distance`.
    #[inline(always)]
    pub fn first_at(&self, distance: f32) -> u32 {
        let Some(&first) = self.bins.get(self.bin(distance)) else { return self.steps.len() as u32 };
        let mut step = first;
        while self.steps.get(step as usize).is_some_and(|step| step.distance < distance) {
            step += 1;
        }
        step
    }

    /// First step whose level is above `level`.
    #[inline(always)]
    pub fn level_end(&self, level: u32) -> u32 {
        self.level_ends[(level as usize).min(self.level_ends.len() - 1)]
    }

    #[inline(always)]
    fn bin(&self, distance: f32) -> usize {
        ((distance - self.near) * self.bins_per_edge) as usize
    }

    fn push(&mut self, step: Step) {
        // The same rounding here and in the search, so that no step is ever missed.
        let bins = self.bin(step.distance) + 1;
        if bins > self.bins.len() {
            self.bins.resize(bins, self.steps.len() as u32);
        }
        self.steps.push(step);
    }

    fn finish(&mut self, max_level: u32) {
        self.level_ends = (0..=max_level)
            .map(|level| {
                // The first sample can be coarser than those after it: nothing is skipped from there.
                let coarser = |step: &Step| step.level.ceil() > level as f32;
                self.steps.iter().rposition(|step| !coarser(step)).map_or(0, |last| last as u32 + 1)
            })
            .collect();
    }
}

/// k = c · tan θ.
fn growth(settings: &Settings, tan_half_angle: f32) -> f64 {
    let growth = f64::from(settings.growth) * f64::from(tan_half_angle.max(0.0));
    let least = match settings.step {
        StepRule::Literal => MIN_LITERAL_GROWTH,
        StepRule::Floored(_) => 0.0,
    };
    growth.clamp(least, MAX_GROWTH)
}
