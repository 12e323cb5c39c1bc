/// Sweeps of the relaxation, and its over-relaxation factor.
const SWEEPS: usize = 60;
const OVER_RELAXATION: f32 = 1.7;

/// A pixel whose share is computed.
#[derive(Clone, Copy, Debug)]
pub(crate) struct UnknownPixel {
    /// Index in the grid.
    pub pixel: usize,
    /// Weight λ of its prior, above 0.
    pub weight: f32,
    /// Prior q, in [0, 1].
    pub prior: f32,
}

/// Minimises `Σ λᵢ (αᵢ − qᵢ)² + Σ wᵢⱼ (αᵢ − αⱼ)²` over the shares αᵢ of the `open` pixels by successive
/// over-relaxation; all other shares are fixed.
///
/// `links` are the weights to the next pixel of the row and of the column; they are 0 beyond the grid.
pub(crate) fn solve_random_walk(
    mut share: Vec<f32>,
    width: usize,
    open: &[UnknownPixel],
    links: &[[f32; 2]],
) -> Vec<f32> {
    for &UnknownPixel { pixel, prior, .. } in open {
        share[pixel] = prior;
    }
    let count = share.len();
    let mut relax = |&UnknownPixel { pixel: i, weight, prior }: &UnknownPixel| {
        let (mut sum, mut total) = (weight * prior, weight);
        let mut add = |j: usize, link: f32| {
            sum += link * share[j];
            total += link;
        };
        if i % width > 0 {
            add(i - 1, links[i - 1][0]);
        }
        if i % width + 1 < width {
            add(i + 1, links[i][0]);
        }
        if i >= width {
            add(i - width, links[i - width][1]);
        }
        if i + width < count {
            add(i + width, links[i][1]);
        }
        share[i] = (share[i] + OVER_RELAXATION * (sum / total - share[i])).clamp(0.0, 1.0);
    };
    for _ in 0..SWEEPS {
        open.iter().for_each(&mut relax);
    }
    share
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shares_run_evenly_between_fixed_ends_and_jump_where_links_are_weak() {
        // One row from 0 to 1: the potential along resistors in series.
        let count = 21;
        let mut links = vec![[1.0, 0.0]; count];
        links[count - 1][0] = 0.0;
        let open: Vec<UnknownPixel> =
            (1..count - 1).map(|pixel| UnknownPixel { pixel, weight: 1e-7, prior: 0.5 }).collect();
        let mut ends = vec![0.0; count];
        ends[count - 1] = 1.0;
        for (i, share) in solve_random_walk(ends.clone(), count, &open, &links).into_iter().enumerate() {
            assert!((share - i as f32 / 20.0).abs() < 1e-3, "{i}: {share}");
        }
        links[7][0] = 0.01;
        for (i, share) in solve_random_walk(ends, count, &open, &links).into_iter().enumerate() {
            let resistance = |to: usize| to as f32 + if to > 7 { 99.0 } else { 0.0 };
            assert!((share - resistance(i) / resistance(20)).abs() < 1e-3, "{i}: {share}");
        }
    }

    #[test]
    fn priors_pull_as_they_weigh() {
        // Two pixels linked by w, with priors 0 and 1 of weight λ: α = w / (λ + 2 w), and 1 − α.
        let open = [0, 1].map(|pixel| UnknownPixel { pixel, weight: 3.0, prior: pixel as f32 });
        for (width, links) in [(2, [[0.5, 0.0], [0.0, 0.0]]), (1, [[0.0, 0.5], [0.0, 0.0]])] {
            let found = solve_random_walk(vec![0.3; 2], width, &open, &links);
            assert!((found[0] - 0.125).abs() < 1e-5 && (found[1] - 0.875).abs() < 1e-5, "{found:?}");
        }
    }
}
