//! The sparsest lamps that explain the shading of what is seen: a lasso in the log domain.

/// What is known and what is sought.
///
/// A diffuse place `i` of radiance `L` on a segment of constant albedo ρ obeys `ln L = ln(ρ / π) + ln E`, and the irradiance `E` is what is
/// seen, a scale times what is guessed, and lamps.
pub(crate) struct Problem {
    /// `ln L` of each place.
    pub log_radiance: Vec<f32>,
    /// Whether `L` is but the least that it can be.
    pub clipped: Vec<bool>,
    /// How much each place counts; about 1.
    pub weights: Vec<f32>,
    /// Which segment it lies on.
    pub segments: Vec<usize>,
    /// Irradiance by what is seen.
    pub seen: Vec<f32>,
    /// Irradiance by what is guessed.
    pub guessed: Vec<f32>,
    /// Irradiance by each lamp of radiance 1: lamp after lamp, all places of each.
    pub lamps: Vec<Vec<f32>>,
    /// What a lamp's share of the light costs.
    pub costs: Vec<f32>,
}

/// What explains it.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Solution {
    /// Radiance of each lamp.
    pub radiance: Vec<f32>,
    /// Factor on what is guessed.
    pub scale: f32,
}

/// Deviation of the logarithm of radiance from what albedo and irradiance say: texture, gloss, faulty normals.
const NOISE: f32 = 0.15;

/// Residuals above this many deviations count linearly (Huber 1964).
const HUBER: f32 = 1.5;

/// Mean and deviation of ln(ρ / π) of things in rooms.
const LOG_ALBEDO: (f32, f32) = (-1.3, 0.6);

/// ln(ρ / π) of the whitest things: nothing gives more light than it gets.
const MAX_LOG_ALBEDO: f32 = -1.25;

/// Deviation of the logarithm of the factor on what is guessed.
const SCALE_DEVIATION: f32 = 0.3;

/// Times that the problem is made linear, and sweeps over all lamps each time.
const OUTER: usize = 25;
const SWEEPS: usize = 12;

impl Problem {
    /// Irradiance of each place, above 0.
    pub fn irradiance(&self, solution: &Solution) -> Vec<f32> {
        let mut sum: Vec<f32> =
            self.seen.iter().zip(&self.guessed).map(|(seen, guessed)| seen + solution.scale * guessed).collect();
        for (lamp, &radiance) in self.lamps.iter().zip(&solution.radiance).filter(|(_, radiance)| **radiance > 0.0) {
            sum.iter_mut().zip(lamp).for_each(|(sum, lamp)| *sum += radiance * lamp);
        }
        sum.iter_mut().for_each(|sum| *sum = sum.max(1e-6));
        sum
    }

    /// Of each place: `ln L − ln E` less the mean log albedo, and how much the residual counts.
    fn residuals(&self, irradiance: &[f32]) -> Vec<f32> {
        let residual = |(log_radiance, irradiance): (&f32, &f32)| log_radiance - irradiance.ln() - LOG_ALBEDO.0;
        self.log_radiance.iter().zip(irradiance).map(residual).collect()
    }

    /// Sum of weights and weighted sum of each segment.
    fn means(&self, residuals: &[f32], weights: &[f32]) -> Vec<Segment> {
        let count = self.segments.iter().max().map_or(0, |last| last + 1);
        let mut sums = vec![(0.0f32, 0.0f32); count];
        for ((&segment, residual), weight) in self.segments.iter().zip(residuals).zip(weights) {
            sums[segment].0 += weight;
            sums[segment].1 += weight * residual;
        }
        // Random effects: a segment's mean is its albedo, as far as there is one to be told from noise.
        let of = |(weight, sum): (f32, f32)| {
            let share = LOG_ALBEDO.1.powi(2) / (LOG_ALBEDO.1.powi(2) + NOISE * NOISE / weight.max(1e-6));
            let mean = if weight > 0.0 { sum / weight } else { 0.0 };
            Segment { albedo: share * mean, demeaned: 1.0 - (1.0 - share).sqrt() }
        };
        sums.into_iter().map(of).collect()
    }

    /// Half of the sum of squares over the noise, with the priors.
    fn cost(&self, solution: &Solution) -> f32 {
        let residuals = self.residuals(&self.irradiance(solution));
        let weights = self.robust(&residuals, &self.means(&residuals, &self.weights));
        let segments = self.means(&residuals, &weights);
        let mut sum = 0.0;
        for (i, residual) in residuals.iter().enumerate() {
            let own = residual - segments[self.segments[i]].albedo;
            if !(self.clipped[i] && own < 0.0) {
                sum += self.weights[i] * huber(own / NOISE);
            }
            sum += self.weights[i] * huber((residual + LOG_ALBEDO.0 - MAX_LOG_ALBEDO).max(0.0) / NOISE);
        }
        let albedos = segments.iter().map(|segment| 0.5 * (segment.albedo / LOG_ALBEDO.1).powi(2)).sum::<f32>();
        let lamps = self.costs.iter().zip(&solution.radiance).map(|(cost, radiance)| cost * radiance).sum::<f32>();
        sum + albedos + lamps + 0.5 * (solution.scale.ln() / SCALE_DEVIATION).powi(2)
    }

    /// Weights under which squares are as Huber's function; places that are brighter than can be told count only where they should be brighter.
    fn robust(&self, residuals: &[f32], segments: &[Segment]) -> Vec<f32> {
        let weight = |(i, residual): (usize, &f32)| {
            let own = (residual - segments[self.segments[i]].albedo) / NOISE;
            let counts = !(self.clipped[i] && own < 0.0);
            if counts { self.weights[i] * (HUBER / own.abs().max(HUBER)) } else { 0.0 }
        };
        residuals.iter().enumerate().map(weight).collect()
    }
}

/// The albedo of a segment, relative to the mean of all things, and what share of it is taken out of its residuals.
#[derive(Clone, Copy)]
struct Segment {
    albedo: f32,
    demeaned: f32,
}

fn huber(deviations: f32) -> f32 {
    let size = deviations.abs();
    if size < HUBER { 0.5 * size * size } else { HUBER * (size - 0.5 * HUBER) }
}

/// Gauss-Newton steps, each a lasso by coordinate descent (Friedman et al. 2010), with the albedos eliminated.
pub(crate) fn solve(problem: &Problem) -> Solution {
    let (places, lamps) = (problem.log_radiance.len(), problem.lamps.len());
    let mut solution = Solution { radiance: vec![0.0; lamps], scale: 1.0 };
    if places == 0 {
        return solution;
    }
    let mut cost = problem.cost(&solution);
    for _ in 0..OUTER {
        let irradiance = problem.irradiance(&solution);
        let residuals = problem.residuals(&irradiance);
        let first = problem.means(&residuals, &problem.weights);
        let weights = problem.robust(&residuals, &first);
        let segments = problem.means(&residuals, &weights);
        let demeaned = |values: &[f32]| -> Vec<f32> {
            let mut sums = vec![(0.0f32, 0.0f32); segments.len()];
            for ((&segment, value), weight) in problem.segments.iter().zip(values).zip(&weights) {
                sums[segment].0 += weight;
                sums[segment].1 += weight * value;
            }
            let own = |(value, &segment): (&f32, &usize)| {
                let (weight, sum) = sums[segment];
                value - if weight > 0.0 { segments[segment].demeaned * sum / weight } else { 0.0 }
            };
            values.iter().zip(&problem.segments).map(own).collect()
        };
        // Rows: the residuals without albedo, then those of places that give more than the whitest thing would.
        let excess: Vec<f32> = residuals.iter().map(|r| (r + LOG_ALBEDO.0 - MAX_LOG_ALBEDO).max(0.0)).collect();
        let excess_weights: Vec<f32> = excess
            .iter()
            .zip(&problem.weights)
            .map(|(excess, weight)| {
                let own = excess / NOISE;
                if own > 0.0 { weight * (HUBER / own.max(HUBER)) } else { 0.0 }
            })
            .collect();
        let scale = 1.0 / (NOISE * NOISE);
        let row_weights: Vec<f32> = weights.iter().chain(&excess_weights).map(|weight| weight * scale).collect();
        let mut rows: Vec<f32> = demeaned(&residuals).into_iter().chain(excess).collect();
        let column = |light: &[f32], factor: f32| -> Vec<f32> {
            let slope: Vec<f32> = light.iter().zip(&irradiance).map(|(light, all)| factor * light / all).collect();
            demeaned(&slope).into_iter().chain(slope).collect()
        };
        let mut columns: Vec<Vec<f32>> = problem.lamps.iter().map(|lamp| column(lamp, 1.0)).collect();
        columns.push(column(&problem.guessed, solution.scale));
        let norms: Vec<f32> = columns
            .iter()
            .map(|column| column.iter().zip(&row_weights).map(|(value, weight)| weight * value * value).sum())
            .collect();
        let mut next = solution.radiance.clone();
        next.push(solution.scale.ln());
        for sweep in 0..SWEEPS {
            let mut largest = 0.0f32;
            for (j, column) in columns.iter().enumerate() {
                let is_lamp = j < lamps;
                if norms[j] <= 1e-12 {
                    continue;
                }
                let slope: f32 = column
                    .iter()
                    .zip(&rows)
                    .zip(&row_weights)
                    .map(|((column, row), weight)| weight * column * row)
                    .sum();
                let old = next[j];
                next[j] = if is_lamp {
                    (old + (slope - problem.costs[j]) / norms[j]).max(0.0)
                } else {
                    let prior = 1.0 / (SCALE_DEVIATION * SCALE_DEVIATION);
                    ((norms[j] * old + slope) / (norms[j] + prior)).clamp(-1.5, 1.0)
                };
                let step = next[j] - old;
                if step != 0.0 {
                    rows.iter_mut().zip(column).for_each(|(row, column)| *row -= step * column);
                    largest = largest.max(step.abs() * norms[j].sqrt());
                }
            }
            if sweep > 0 && largest < 1e-3 {
                break;
            }
        }
        // The whole step, or as much of it as makes things better.
        let mut share = 1.0f32;
        let better = (0..8).find_map(|_| {
            let mixed = |from: f32, to: f32| from + share * (to - from);
            let radiance = solution.radiance.iter().zip(&next).map(|(&from, &to)| mixed(from, to)).collect();
            let tried = Solution { radiance, scale: mixed(solution.scale.ln(), next[lamps]).exp() };
            share *= 0.5;
            let own = problem.cost(&tried);
            (own < cost).then_some((tried, own))
        });
        let Some((tried, own)) = better else { break };
        let gain = cost - own;
        (solution, cost) = (tried, own);
        if gain < 1e-4 * cost.abs() {
            break;
        }
    }
    solution
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use lo_geometry::Vec3;

    use super::*;

    /// Places on a floor and two walls of three albedos, lit by lamps in a ceiling 2.5 m above.
    fn room(lamps: &[(f32, f32)], albedos: [f32; 3], true_radiance: &[f32]) -> Problem {
        let mut places: Vec<(Vec3, Vec3, usize)> = Vec::new();
        for (i, j) in (0..100).map(|n| (n % 10, n / 10)) {
            let (a, b) = (0.4 * i as f32 + 0.2, 0.25 * j as f32 + 0.1);
            places.push((Vec3::new(a, 0.0, 0.4 * j as f32 + 0.2), Vec3::Y, 0));
            places.push((Vec3::new(a, b, 0.0), Vec3::Z, 1));
            places.push((Vec3::new(0.0, b, a), Vec3::X, 2));
        }
        let of_lamp = |&(x, z): &(f32, f32)| -> Vec<f32> {
            let at = Vec3::new(x, 2.5, z);
            let on = |&(position, normal, _): &(Vec3, Vec3, usize)| {
                let to = at - position;
                let direction = to.normalize();
                (normal.dot(direction).max(0.0) * direction.y.max(0.0)) * 0.09 / to.length_squared()
            };
            places.iter().map(on).collect()
        };
        let lamps: Vec<Vec<f32>> = lamps.iter().map(of_lamp).collect();
        let count = places.len();
        let light =
            |i: usize| 0.2 + lamps.iter().zip(true_radiance).map(|(lamp, radiance)| lamp[i] * radiance).sum::<f32>();
        let log_radiance = (0..count).map(|i| (albedos[places[i].2] / std::f32::consts::PI * light(i)).ln()).collect();
        let costs = lamps.iter().map(|lamp| lamp.iter().sum::<f32>() / 0.5 * 0.2).collect();
        Problem {
            log_radiance,
            clipped: vec![false; count],
            weights: vec![1.0; count],
            segments: places.iter().map(|place| place.2).collect(),
            seen: vec![0.1; count],
            guessed: vec![0.1; count],
            lamps,
            costs,
        }
    }

    const GRID: [(f32, f32); 9] =
        [(0.5, 0.5), (2.0, 0.5), (3.5, 0.5), (0.5, 2.0), (2.0, 2.0), (3.5, 2.0), (0.5, 3.5), (2.0, 3.5), (3.5, 3.5)];

    #[test]
    fn the_lamp_that_shines_is_found_whatever_the_albedos() {
        for lamp in [0, 2, 4, 7] {
            let mut truth = [0.0; 9];
            truth[lamp] = 60.0;
            let solution = solve(&room(&GRID, [0.3, 0.7, 0.5], &truth));
            let total: f32 = solution.radiance.iter().sum();
            assert!(solution.radiance[lamp] > 0.8 * total, "{lamp}: {solution:?}");
            assert!((0.6..1.4).contains(&(total / 60.0)), "{lamp}: {solution:?}");
        }
    }

    #[test]
    fn even_light_needs_no_lamp() {
        let solution = solve(&room(&GRID, [0.3, 0.7, 0.5], &[0.0; 9]));
        assert!(solution.radiance.iter().sum::<f32>() < 1.0, "{solution:?}");
        assert!((0.8..1.25).contains(&solution.scale), "{solution:?}");
    }

    #[test]
    fn clipped_places_ask_for_no_less_light() {
        let mut truth = [0.0; 9];
        truth[4] = 60.0;
        let mut problem = room(&GRID, [0.3, 0.7, 0.5], &truth);
        // The floor's brightest places are cut off at half of what they are.
        for i in (0..300).filter(|i| i % 3 == 0) {
            let most = problem.log_radiance[165] - 0.7;
            if problem.log_radiance[i] > most {
                problem.log_radiance[i] = most;
                problem.clipped[i] = true;
            }
        }
        assert!(problem.clipped.iter().filter(|clipped| **clipped).count() > 20);
        let solution = solve(&problem);
        let total: f32 = solution.radiance.iter().sum();
        assert!(solution.radiance[4] > 0.7 * total && total > 36.0, "{solution:?}");
    }

    #[test]
    fn nothing_seen_is_nothing_known() {
        let empty = Problem {
            log_radiance: vec![],
            clipped: vec![],
            weights: vec![],
            segments: vec![],
            seen: vec![],
            guessed: vec![],
            lamps: vec![vec![]],
            costs: vec![1.0],
        };
        assert_eq!(solve(&empty), Solution { radiance: vec![0.0], scale: 1.0 });
    }
}
