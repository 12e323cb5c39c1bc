//! Compares given depth with the built-in network's prediction.

use lo_imaging::DepthMap;

use crate::EstimateWarning;

/// Rank correlation below which given depth seems to be inverse. That of right maps is above 0 (`docs/method.md` §1.3),
/// except by chance on a single flat wall.
const INVERSE_BELOW: f64 = -0.1;

/// Rank correlation from which a map that fits better mirrored seems to be mirrored. That of right maps is from 0.7 on.
const MIRRORED_FROM: f64 = 0.7;

/// Smallest difference to that of the map as it is. That of right maps is up to 0.02, where a room is symmetric.
const MIRRORED_BY: f64 = 0.25;

/// Ratio of given to predicted depth from which the scale seems wrong, and inverse of the smallest.
const MAX_RATIO: f64 = 3.0;

/// Largest ratio of depths of a map that is constant but for its rounding.
const CONSTANT: f64 = 1.001;

/// Range of median depths of ordinary photos of rooms, in metres, within which the network's scale is trusted.
const TYPICAL_M: [f64; 2] = [0.8, 6.0];

/// Pixels compared along each side.
const SAMPLES: usize = 64;

/// Fewest pixels that can be compared.
const MIN_COUNT: usize = 64;

/// Compares depth of the same view, in metres and at any resolution.
///
/// Returns a warning if `given_m` is constant where `own_m` is not, is mirrored, decreases where `own_m` increases, or
/// if its scale is far from that of `own_m`. Returns `None` if they agree, or have too few readings in common.
pub(crate) fn compare(given_m: &DepthMap, own_m: &DepthMap) -> Option<EstimateWarning> {
    let pairs = pairs(given_m, own_m);
    if pairs.len() < MIN_COUNT {
        return None;
    }
    let range = |side: usize| {
        let values = pairs.iter().map(|pair| pair[side]);
        values.fold([f64::INFINITY, 0.0f64], |[least, most], z| [least.min(z), most.max(z)])
    };
    let ([least, most], [own_least, own_most]) = (range(0), range(1));
    if most <= CONSTANT * least && own_most > MAX_RATIO * own_least {
        return Some(EstimateWarning::ConstantDepth { depth_m: least });
    }
    let rank_correlation = rank_correlation(&pairs);
    let mirrored = mirrored_correlation(given_m, own_m);
    if mirrored > MIRRORED_FROM.max(rank_correlation + MIRRORED_BY).max(-rank_correlation) {
        return Some(EstimateWarning::MirroredDepth { rank_correlation, mirrored });
    }
    if rank_correlation < INVERSE_BELOW {
        return Some(EstimateWarning::InverseDepth { rank_correlation });
    }
    let ratio = median(pairs.iter().map(|[given, own]| given / own));
    // A prediction that no ordinary photo of a room has is no evidence against one that it may have.
    let own_m = median(pairs.iter().map(|[_, own]| *own));
    let from_typical = ratio * own_m / own_m.clamp(TYPICAL_M[0], TYPICAL_M[1]);
    let is_wrong = |ratio: f64| !(MAX_RATIO.recip()..=MAX_RATIO).contains(&ratio);
    (is_wrong(ratio) && is_wrong(from_typical)).then_some(EstimateWarning::DepthScale { ratio })
}

/// Rank correlation of the given map, mirrored from left to right; 0 without enough readings in common.
fn mirrored_correlation(given_m: &DepthMap, own_m: &DepthMap) -> f64 {
    let pairs = pairs(&given_m.mirrored(), own_m);
    if pairs.len() < MIN_COUNT { 0.0 } else { rank_correlation(&pairs) }
}

fn median(values: impl Iterator<Item = f64>) -> f64 {
    let mut values: Vec<f64> = values.collect();
    let middle = values.len() / 2;
    *values.select_nth_unstable_by(middle, f64::total_cmp).1
}

/// Depths of both maps on a regular grid, where both have a reading.
fn pairs(given_m: &DepthMap, own_m: &DepthMap) -> Vec<[f64; 2]> {
    let at = |map: &DepthMap, column: usize, row: usize| {
        let place = |index: usize, of: usize| (2 * index + 1) * of / (2 * SAMPLES);
        f64::from(map[(place(column, map.width()), place(row, map.height()))])
    };
    let grid = (0..SAMPLES).flat_map(|row| (0..SAMPLES).map(move |column| (column, row)));
    let pairs = grid.map(|(column, row)| [at(given_m, column, row), at(own_m, column, row)]);
    pairs.filter(|pair| pair.iter().all(|z| z.is_finite() && *z > 0.0)).collect()
}

/// Spearman's rank correlation; 0 if one side is constant.
fn rank_correlation(pairs: &[[f64; 2]]) -> f64 {
    let [a, b] = [0, 1].map(|side| ranks(&pairs.iter().map(|pair| pair[side]).collect::<Vec<f64>>()));
    let mean = 0.5 * (pairs.len() as f64 - 1.0);
    let product = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| (a - mean) * (b - mean)).sum::<f64>();
    let spread = (product(&a, &a) * product(&b, &b)).sqrt();
    if spread > 0.0 { product(&a, &b) / spread } else { 0.0 }
}

/// Rank of each value from 0; equal values share their mean rank.
fn ranks(values: &[f64]) -> Vec<f64> {
    let mut order: Vec<usize> = (0..values.len()).collect();
    order.sort_by(|&i, &j| values[i].total_cmp(&values[j]));
    let mut ranks = vec![0.0; values.len()];
    let mut first = 0;
    for equal in order.chunk_by(|&i, &j| values[i] == values[j]) {
        let rank = first as f64 + 0.5 * (equal.len() as f64 - 1.0);
        equal.iter().for_each(|&index| ranks[index] = rank);
        first += equal.len();
    }
    ranks
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A slanted floor with a box on it, 1 to 6 metres.
    fn depth(width: usize, height: usize) -> DepthMap {
        DepthMap::from_fn(width, height, |x, y| {
            let (u, v) = (x as f32 / width as f32, y as f32 / height as f32);
            let floor = 6.0 / (1.0 + 5.0 * v);
            if (0.25..0.6).contains(&u) && (0.2..0.65).contains(&v) { 0.7 * floor } else { floor }
        })
    }

    #[test]
    fn right_depth_of_another_size_and_with_holes_is_quiet() {
        let mut given = depth(320, 240).map(|z| 1.4 * z);
        given.pixels_mut().iter_mut().step_by(3).for_each(|z| *z = 0.0);
        assert_eq!(compare(&given, &depth(64, 48)), None);
        // Nothing to compare, and nothing to rank.
        assert_eq!(compare(&given.map(|_| 0.0), &depth(64, 48)), None);
        assert_eq!(compare(&given.map(|_| 2.0), &depth(64, 48).map(|z| 2.0 + 0.1 * z)), None);
    }

    #[test]
    fn constant_depth_of_a_room_is_recognised() {
        let found = compare(&depth(320, 240).map(|_| 2.0), &depth(64, 48));
        assert_eq!(found, Some(EstimateWarning::ConstantDepth { depth_m: 2.0 }));
    }

    #[test]
    fn inverse_depth_is_recognised_at_any_scale() {
        for scale in [0.1, 1.0, 20.0] {
            let warning = compare(&depth(320, 240).map(|z| scale / z), &depth(64, 48));
            let Some(EstimateWarning::InverseDepth { rank_correlation }) = warning else {
                panic!("at a scale of {scale}: {warning:?}")
            };
            assert!(rank_correlation < -0.99, "{rank_correlation}");
        }
    }

    #[test]
    fn mirrored_depth_is_told_from_inverse_depth() {
        // A floor that rises to the right, with a box.
        let slanted = DepthMap::from_fn(320, 240, |x, y| depth(320, 240)[(x, y)] * (1.0 + 4.0 * x as f32 / 320.0));
        assert!(matches!(compare(&slanted.mirrored(), &slanted), Some(EstimateWarning::MirroredDepth { .. })));
        assert!(matches!(compare(&slanted.map(|z| 1.0 / z), &slanted), Some(EstimateWarning::InverseDepth { .. })));
        assert_eq!(compare(&slanted, &slanted), None);
    }

    #[test]
    fn wrong_scales_are_recognised() {
        for scale in [0.2, 5.0, 1000.0] {
            let warning = compare(&depth(320, 240).map(|z| scale * z), &depth(64, 48));
            let Some(EstimateWarning::DepthScale { ratio }) = warning else { panic!("{scale}: {warning:?}") };
            // f32, and the grid's pixels of two sizes
            assert!((ratio / f64::from(scale) - 1.0).abs() < 0.02, "{ratio}");
        }
    }

    #[test]
    fn a_prediction_of_no_ordinary_photo_does_not_count() {
        // A median of 0.35 m of the network, of 1.4 m of the sensor: both views of a cabinet, the second likely.
        let [own, given] = [0.35, 1.4].map(|m| depth(64, 48).map(|z| m / 2.0 * z));
        assert_eq!(compare(&given, &own), None);
        assert!(matches!(compare(&given.map(|z| 5.0 * z), &own), Some(EstimateWarning::DepthScale { .. })));
        // Two views from near that agree are right.
        assert_eq!(compare(&own.map(|z| 0.8 * z), &own), None);
    }

    #[test]
    fn ranks_of_equal_values_are_shared() {
        // By hand: ranks 0.5, 0.5, 2, 3 and 3, 2, 1, 0.
        let pairs = [[1.0, 9.0], [1.0, 8.0], [2.0, 7.0], [3.0, 6.0]];
        let expected = -4.5 / (4.5f64 * 5.0).sqrt();
        assert!((rank_correlation(&pairs) - expected).abs() < 1e-12);
    }
}
