//! Splits leaves where the panorama varies, and gives them its light.

use lo_octree::MAX_DEPTH;

use super::accumulator::LeafAccumulator;
use super::deposits::RayDeposits;
use super::leaves::{Leaf, LeafSet};
use super::rays::Rays;

/// Standard deviation of ln(1 + luminance / median) within a leaf above which it is split.
const DETAIL: f64 = 0.1;

/// Least number of rays, and of the panorama's pixels, in a leaf that is split.
const MIN_RAYS: u32 = 3;
const MIN_PIXELS: f64 = 1.0;

/// Deviation caused by lamps. Their leaves are split one level further, while at least this many rays hit them.
const LAMP_DETAIL: f64 = 0.5;
const LAMP_RAYS: u32 = 2;

/// Opacity of leaves with lamps; parts of opaque leaves have at least this.
const CLOSING_ALPHA: f32 = 0.89;

impl LeafSet {
    /// Returns the leaves in which the panorama varies most, such that at most `budget` leaves are added. Leaves of
    /// depth `finest` are not split, except for lamps.
    pub fn to_split(&self, deposits: &RayDeposits, rays: &Rays, finest: u32, budget: usize) -> Vec<usize> {
        let least = f64::from(MIN_RAYS).max(MIN_PIXELS * (rays.per_pixel * rays.per_pixel) as f64);
        let gain = |(index, (leaf, sum)): (usize, (&Leaf, &LeafAccumulator))| {
            let variance = sum.variance();
            let lamp = variance > LAMP_DETAIL * LAMP_DETAIL;
            let (deepest, least) =
                if lamp { ((finest + 1).min(MAX_DEPTH), f64::from(LAMP_RAYS)) } else { (finest, least) };
            let fine = leaf.depth >= deepest || f64::from(sum.rays) < least;
            (!fine && variance > DETAIL * DETAIL).then_some((sum.weight * variance, index))
        };
        let mut gains: Vec<(f64, usize)> =
            self.leaves.iter().zip(&deposits.sums).enumerate().filter_map(gain).collect();
        gains.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
        gains.truncate(budget / 7);
        gains.into_iter().map(|(_, index)| index).collect()
    }

    /// Splits leaves into eight. Crossing two halves has the opacity of the whole.
    pub fn split(&mut self, chosen: &[usize], deposits: &RayDeposits) {
        for &index in chosen {
            let whole = self.leaves[index];
            let [r, g, b, alpha] = whole.rgba;
            let rgba = [r, g, b, 1.0 - (1.0 - alpha).sqrt()];
            // A child that no ray hits has the whole's light, without the lamp.
            let light = deposits.sums[index].mean().or(whole.light);
            let child = |child: u32| Leaf { depth: whole.depth + 1, key: whole.key << 3 | child, rgba, light, ..whole };
            let mut children = (0..8).map(child);
            self.leaves[index] = children.next().unwrap_or(whole);
            self.leaves.extend(children);
        }
    }

    /// Makes leaves with lamps opaque, since their light must not come from in front of or behind them. Returns whether
    /// any changed.
    pub fn close_lamps(&mut self, deposits: &RayDeposits) -> bool {
        let mut closed = false;
        for (leaf, sum) in self.leaves.iter_mut().zip(&deposits.sums) {
            if sum.closing_lamp.iter().any(|&c| c > 0.0) && leaf.rgba[3] < CLOSING_ALPHA {
                leaf.rgba[3] = CLOSING_ALPHA;
                (leaf.closing, closed) = (true, true);
            }
        }
        closed
    }

    /// Assigns light to the leaves. Where the panorama is clipped its light is a lower bound, and the completed
    /// radiance may be greater.
    pub fn assign_light(&mut self, deposits: &RayDeposits) {
        for (leaf, sum) in self.leaves.iter_mut().zip(&deposits.sums) {
            if let Some(mean) = sum.mean() {
                let bound = sum.clipped > 0.5 * sum.weight;
                leaf.light = Some(std::array::from_fn(|c| if bound { mean[c].max(leaf.rgba[c]) } else { mean[c] }));
                leaf.lamp = sum.lamp();
            }
        }
    }
}
