//! Robust least squares in the log domain for the factors of lamps and surfaces, from the shading of observed surfaces.

use lo_geometry::{Mat3, Vec3};

/// Observations and unknowns.
///
/// A diffuse sample `i` of radiance `L` on a segment of constant albedo ρ obeys `ln L = ln(ρ / π) + ln E`. The
/// irradiance `E` is the sum of the light from observed surfaces, and of that from inferred surfaces, inferred lamps
/// and clipped lamps, each times a factor.
pub(crate) struct Problem {
    /// `ln L` of each sample.
    pub log_radiance: Vec<f32>,
    /// Whether `L` is only a lower bound.
    pub clipped: Vec<bool>,
    /// Weight of each sample; about 1.
    pub weights: Vec<f32>,
    /// Segment of each sample.
    pub segments: Vec<usize>,
    /// Irradiance from observed surfaces.
    pub seen: Vec<f32>,
    /// Irradiance from inferred surfaces.
    pub surfaces: Vec<f32>,
    /// Irradiance from inferred lamps.
    pub lamps: Vec<f32>,
    /// Irradiance from clipped lamps, the part above the clipping level.
    pub clipped_lamps: Vec<f32>,
    /// Prior of the factors.
    pub prior: Prior,
}

/// Fitted factors.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Solution {
    /// Factor of inferred surfaces.
    pub surfaces: f32,
    /// Factor of inferred lamps.
    pub lamps: f32,
    /// Factor of clipped lamps.
    pub clipped_lamps: f32,
}

/// Standard deviation of log radiance from the model: texture, gloss, wrong normals.
const NOISE: f32 = 0.15;

/// Residuals above this many deviations have linear cost (Huber 1964).
const HUBER: f32 = 1.5;

/// Mean and standard deviation of ln(ρ / π) of objects in rooms.
const LOG_ALBEDO: (f32, f32) = (-1.3, 0.6);

/// ln(ρ / π) of the whitest objects: nothing reflects more light than it receives.
const MAX_LOG_ALBEDO: f32 = -1.25;

/// Means and standard deviations of the log factors of surfaces and lamps: networks predict the likeliest light, in
/// which lamps are averaged away.
const SURFACES: (f32, f32) = (0.0, 0.2);
const LAMPS: (f32, f32) = (1.5, 0.5);

/// Mean and standard deviation for lamps that are as bright as expected.
const EXPECTED_LAMPS: (f32, f32) = (0.0, 0.3);

/// Mean and standard deviation for clipped lamps: the error of [`crate::highlights`].
const CLIPPED_LAMPS: (f32, f32) = (0.1, 0.8);

/// Weight of a sample, since the errors of samples have common causes.
const TRUST: f32 = 0.01;

/// Greatest change of a log factor per step.
const MAX_STEP: f32 = 1.0;

const STEPS: usize = 25;

/// Means and precisions of the log factors of surfaces, lamps and clipped lamps.
#[derive(Clone, Copy)]
pub(crate) struct Prior {
    means: Vec3,
    precisions: Vec3,
}

impl Prior {
    /// Prior where a network averaged lamps away.
    pub const AVERAGED: Self = Self::with_lamps(LAMPS);
    /// Prior where lamps are as bright as expected.
    pub const EXPECTED: Self = Self::with_lamps(EXPECTED_LAMPS);

    const fn with_lamps(lamps: (f32, f32)) -> Self {
        Self {
            means: Vec3::new(SURFACES.0, lamps.0, CLIPPED_LAMPS.0),
            precisions: Vec3::new(precision(SURFACES), precision(lamps), precision(CLIPPED_LAMPS)),
        }
    }
}

const fn precision((_, deviation): (f32, f32)) -> f32 {
    1.0 / (deviation * deviation)
}

fn solution(logs: Vec3) -> Solution {
    let [surfaces, lamps, clipped_lamps] = logs.exp().to_array();
    Solution { surfaces, lamps, clipped_lamps }
}

/// Log albedo of a segment relative to the mean, and the share of its mean that is subtracted from its samples.
#[derive(Clone, Copy)]
struct Segment {
    albedo: f32,
    demeaned: f32,
}

impl Problem {
    /// Returns the irradiance of each sample, above 0.
    pub fn irradiance(&self, solution: Solution) -> Vec<f32> {
        let Solution { surfaces, lamps, clipped_lamps } = solution;
        let at = |i: usize| {
            let inferred = surfaces * self.surfaces[i] + lamps * self.lamps[i] + clipped_lamps * self.clipped_lamps[i];
            (self.seen[i] + inferred).max(1e-6)
        };
        (0..self.seen.len()).map(at).collect()
    }

    /// Returns `ln L − ln E` of each sample, minus the mean log albedo.
    fn residuals(&self, irradiance: &[f32]) -> Vec<f32> {
        let residual = |(log_radiance, irradiance): (&f32, &f32)| log_radiance - irradiance.ln() - LOG_ALBEDO.0;
        self.log_radiance.iter().zip(irradiance).map(residual).collect()
    }

    /// Returns the weighted means of each segment. Random effects: a segment's mean is its albedo, shrunk where it
    /// cannot be separated from noise.
    fn segments(&self, residuals: &[f32], weights: &[f32]) -> Vec<Segment> {
        let of = |(weight, sum): (f32, f32)| {
            let share = LOG_ALBEDO.1.powi(2) / (LOG_ALBEDO.1.powi(2) + NOISE * NOISE / weight.max(1e-6));
            let mean = if weight > 0.0 { sum / weight } else { 0.0 };
            Segment { albedo: share * mean, demeaned: 1.0 - (1.0 - share).sqrt() }
        };
        self.sums(residuals, weights).into_iter().map(of).collect()
    }

    /// Returns the sum of weights and the weighted sum of each segment.
    fn sums(&self, values: &[f32], weights: &[f32]) -> Vec<(f32, f32)> {
        let count = self.segments.iter().max().map_or(0, |last| last + 1);
        let mut sums = vec![(0.0f32, 0.0f32); count];
        for ((&segment, value), weight) in self.segments.iter().zip(values).zip(weights) {
            sums[segment].0 += weight;
            sums[segment].1 += weight * value;
        }
        sums
    }

    /// Subtracts the segments' means from values, to the extent that these are albedos.
    fn demeaned(&self, values: &[f32], weights: &[f32], segments: &[Segment]) -> Vec<f32> {
        let sums = self.sums(values, weights);
        let own = |(value, &segment): (&f32, &usize)| {
            let (weight, sum) = sums[segment];
            value - if weight > 0.0 { segments[segment].demeaned * sum / weight } else { 0.0 }
        };
        values.iter().zip(&self.segments).map(own).collect()
    }

    /// Returns weights under which squares equal Huber's function. Clipped samples count only where they should be
    /// brighter.
    fn robust(&self, residuals: &[f32], segments: &[Segment]) -> Vec<f32> {
        let weight = |(i, residual): (usize, &f32)| {
            let own = (residual - segments[self.segments[i]].albedo) / NOISE;
            let counts = !(self.clipped[i] && own < 0.0);
            if counts { self.weights[i] * (HUBER / own.abs().max(HUBER)) } else { 0.0 }
        };
        residuals.iter().enumerate().map(weight).collect()
    }

    /// Returns the negative log probability.
    fn cost(&self, logs: Vec3) -> f32 {
        let residuals = self.residuals(&self.irradiance(solution(logs)));
        let weights = self.robust(&residuals, &self.segments(&residuals, &self.weights));
        let segments = self.segments(&residuals, &weights);
        let mut sum = 0.0;
        for (i, residual) in residuals.iter().enumerate() {
            let own = residual - segments[self.segments[i]].albedo;
            if !(self.clipped[i] && own < 0.0) {
                sum += self.weights[i] * huber(own / NOISE);
            }
            sum += self.weights[i] * huber(above(*residual) / NOISE);
        }
        sum += segments.iter().map(|segment| 0.5 * (segment.albedo / LOG_ALBEDO.1).powi(2)).sum::<f32>();
        let away = logs - self.prior.means;
        TRUST * sum + 0.5 * self.prior.precisions.dot(away * away)
    }
}

/// Returns the log excess of a sample over the whitest object at the same irradiance.
fn above(residual: f32) -> f32 {
    (residual + LOG_ALBEDO.0 - MAX_LOG_ALBEDO).max(0.0)
}

fn huber(deviations: f32) -> f32 {
    let size = deviations.abs();
    if size < HUBER { 0.5 * size * size } else { HUBER * (size - 0.5 * HUBER) }
}

/// Solves by Gauss-Newton steps from the prior's means, with the albedos eliminated.
pub(crate) fn solve(problem: &Problem) -> Solution {
    let mut logs = problem.prior.means;
    let mut cost = problem.cost(logs);
    for _ in 0..STEPS {
        let step = step(problem, logs);
        // The whole step, or the largest halving of it that reduces the cost.
        let better = (0..8).find_map(|halvings| {
            let share = 0.5f32.powi(halvings);
            let tried = logs + share * step;
            let own = problem.cost(tried);
            (own < cost).then_some((tried, own))
        });
        let Some((tried, own)) = better else { break };
        let gain = cost - own;
        (logs, cost) = (tried, own);
        if gain < 1e-4 * cost.abs() {
            break;
        }
    }
    solution(logs)
}

/// Computes a Gauss-Newton step.
fn step(problem: &Problem, logs: Vec3) -> Vec3 {
    let solution = solution(logs);
    let irradiance = problem.irradiance(solution);
    let residuals = problem.residuals(&irradiance);
    let weights = problem.robust(&residuals, &problem.segments(&residuals, &problem.weights));
    let segments = problem.segments(&residuals, &weights);
    // Rows: the residuals without albedo, then the excesses over the whitest object.
    let excess: Vec<f32> = residuals.iter().map(|residual| above(*residual)).collect();
    let excess_weight = |(excess, weight): (&f32, &f32)| {
        let own = excess / NOISE;
        if own > 0.0 { weight * (HUBER / own.max(HUBER)) } else { 0.0 }
    };
    let excess_weights = excess.iter().zip(&problem.weights).map(excess_weight);
    let row_weights: Vec<f32> = weights.iter().copied().chain(excess_weights).collect();
    let rows: Vec<f32> = problem.demeaned(&residuals, &weights, &segments).into_iter().chain(excess).collect();
    let column = |light: &[f32], factor: f32| -> Vec<f32> {
        let slope: Vec<f32> = light.iter().zip(&irradiance).map(|(light, all)| factor * light / all).collect();
        problem.demeaned(&slope, &weights, &segments).into_iter().chain(slope).collect()
    };
    let columns = [
        column(&problem.surfaces, solution.surfaces),
        column(&problem.lamps, solution.lamps),
        column(&problem.clipped_lamps, solution.clipped_lamps),
    ];
    let product = |a: &[f32], b: &[f32]| -> f32 {
        let sum: f32 = a.iter().zip(b).zip(&row_weights).map(|((a, b), weight)| weight * a * b).sum();
        TRUST * sum / (NOISE * NOISE)
    };
    let with_all = |a: &[f32]| Vec3::from(columns.each_ref().map(|column| product(a, column)));
    let [surfaces, lamps, clipped_lamps] = columns.each_ref().map(|column| with_all(column));
    let matrix = Mat3::from_cols(surfaces, lamps, clipped_lamps) + Mat3::from_diagonal(problem.prior.precisions);
    let right = with_all(&rows) - problem.prior.precisions * (logs - problem.prior.means);
    // All precisions are above 0, so the inverse exists.
    (matrix.inverse() * right).clamp(Vec3::splat(-MAX_STEP), Vec3::splat(MAX_STEP))
}

#[cfg(test)]
mod tests {
    use lo_geometry::Vec3;

    use super::*;

    /// Samples on a floor and two walls with three albedos, lit by a lamp of this radiance in a ceiling 2.5 m above;
    /// the prediction `guess` differs.
    fn room(radiance: f32, albedos: [f32; 3], guess: f32) -> Problem {
        let mut places: Vec<(Vec3, Vec3, usize)> = Vec::new();
        for (i, j) in (0..100).map(|n| (n % 10, n / 10)) {
            let (a, b) = (0.4 * i as f32 + 0.2, 0.25 * j as f32 + 0.1);
            places.push((Vec3::new(a, 0.0, 0.4 * j as f32 + 0.2), Vec3::Y, 0));
            places.push((Vec3::new(a, b, 0.0), Vec3::Z, 1));
            places.push((Vec3::new(0.0, b, a), Vec3::X, 2));
        }
        let by_lamp = |&(position, normal, _): &(Vec3, Vec3, usize)| {
            let to = Vec3::new(2.0, 2.5, 2.0) - position;
            let direction = to.normalize();
            normal.dot(direction).max(0.0) * direction.y.max(0.0) * 0.09 / to.length_squared()
        };
        let lamp: Vec<f32> = places.iter().map(by_lamp).collect();
        let seen = |(place, lamp): (&(Vec3, Vec3, usize), &f32)| {
            (albedos[place.2] / std::f32::consts::PI * (0.2 + radiance * lamp)).ln()
        };
        let count = places.len();
        Problem {
            log_radiance: places.iter().zip(&lamp).map(seen).collect(),
            clipped: vec![false; count],
            weights: vec![1.0; count],
            segments: places.iter().map(|place| place.2).collect(),
            seen: vec![0.1; count],
            surfaces: vec![0.1; count],
            lamps: lamp.iter().map(|lamp| guess * lamp).collect(),
            clipped_lamps: vec![0.0; count],
            prior: Prior::AVERAGED,
        }
    }

    #[test]
    fn lamps_that_were_inferred_too_dark_get_brighter_whatever_the_albedos() {
        for albedos in [[0.3, 0.7, 0.5], [0.8, 0.8, 0.2]] {
            let solution = solve(&room(60.0, albedos, 10.0));
            assert!((4.0..8.0).contains(&solution.lamps), "{solution:?}");
            assert!((0.9..1.1).contains(&solution.surfaces), "{solution:?}");
        }
    }

    #[test]
    fn lamps_that_were_inferred_too_bright_get_less_than_is_usual() {
        let usual = LAMPS.0.exp();
        let solution = solve(&room(60.0, [0.3, 0.7, 0.5], 60.0));
        assert!(solution.lamps < 0.75 * usual, "{solution:?}");
    }

    #[test]
    fn clipped_lamps_that_were_restored_too_dark_or_too_bright_are_mended() {
        let solved = |guess: f32| {
            let mut problem = room(60.0, [0.3, 0.7, 0.5], guess);
            std::mem::swap(&mut problem.lamps, &mut problem.clipped_lamps);
            solve(&problem).clipped_lamps
        };
        // At least two fifths of the way from the prior.
        let (dark, right, bright) = (solved(20.0), solved(60.0), solved(180.0));
        assert!((1.55..3.1).contains(&dark), "{dark}");
        assert!((0.8..1.25).contains(&right), "{right}");
        assert!((0.32..0.64).contains(&bright), "{bright}");
    }

    #[test]
    fn clipped_places_ask_for_no_less_light() {
        let mut problem = room(60.0, [0.3, 0.7, 0.5], 10.0);
        let whole = solve(&problem);
        // The floor's brightest samples are clipped at half of their radiance.
        for i in (0..300).filter(|i| i % 3 == 0) {
            let most = problem.log_radiance[165] - 0.7;
            if problem.log_radiance[i] > most {
                problem.log_radiance[i] = most;
                problem.clipped[i] = true;
            }
        }
        assert!(problem.clipped.iter().filter(|clipped| **clipped).count() > 20);
        let solution = solve(&problem);
        assert!(solution.lamps > 0.7 * whole.lamps, "{solution:?} {whole:?}");
    }

    #[test]
    fn without_samples_the_prior_is_returned() {
        let empty = Problem {
            log_radiance: vec![],
            clipped: vec![],
            weights: vec![],
            segments: vec![],
            seen: vec![],
            surfaces: vec![],
            lamps: vec![],
            clipped_lamps: vec![],
            prior: Prior::AVERAGED,
        };
        assert_eq!(solve(&empty), solution(Prior::AVERAGED.means));
    }
}
