use lo_octree::{Octree, xyz_from_key};
use rayon::prelude::*;

use crate::light::{LightInput, NetworkWarning};

/// Logit above which nodes are split, a probability of a third. Needless splits cost little, but a hole in a wall is
/// visible.
const MIN_LOGIT: f32 = -0.7;

/// Source of the occupancy by which the decoder's octree grows.
#[derive(Clone, Copy, Debug)]
pub enum Growth<'a> {
    /// This octree, in training.
    Truth(&'a Octree),
    /// The network's predictions, and the photo's observations.
    Predicted,
}

/// Returns how many nodes of `depth` may be split, for an octree that ends at `last` and a remaining budget of
/// `splits`.
///
/// Observed nodes are always split, at this depth and below. A surface has four times as many nodes one depth further
/// down, and the remaining budget is divided in that proportion. Coarse predictions thus leave room for fine ones.
pub(super) fn max_splits(splits: usize, visible: &Octree, depth: u32, last: u32) -> usize {
    let seen = |depth: u32| visible.levels()[depth as usize].nonempty;
    let free = splits.saturating_sub((depth..last).map(seen).sum());
    let parts = (depth..last).fold(0, |parts, _| 4 * parts + 1);
    (seen(depth) + free / parts).min(splits).max(1)
}

/// Closes the cube: makes the nodes of a full level at its sides non-empty, except where photos show them to be empty.
///
/// Rays that leave through a hole in the grown octree then end in light that the network predicts there, not in the
/// dark.
pub(super) fn close_sides(nonempty: &mut [bool], depth: u32, input: &LightInput) {
    let last = (1 << depth) - 1;
    for (key, nonempty) in (0..).zip(nonempty) {
        let at_side = xyz_from_key(key).iter().any(|&at| at == 0 || at == last);
        *nonempty |= at_side && !input.free.contains_node(input.cube(), depth, key);
    }
}

/// Occupancy of the nodes of a level.
pub(super) struct Occupancy {
    pub nonempty: Vec<bool>,
    /// Deviation from the prediction, if any.
    pub warning: Option<NetworkWarning>,
}

impl Occupancy {
    /// Takes the occupancy from an octree that has the same nodes at this depth.
    pub fn from_truth(truth: &Octree, depth: u32) -> Self {
        Self { nonempty: truth.levels()[depth as usize].rows.iter().map(|&row| row >= 0).collect(), warning: None }
    }

    /// Marks nodes that are observed or have a logit above [`MIN_LOGIT`]: at least one, and at most the `max_count`
    /// likeliest.
    ///
    /// Below the full depth, nodes are children of occupied nodes. Where a wall's position among small leaves is
    /// uncertain, none of the eight children may be likely. All of them are then kept, except those that photos show to
    /// be empty, as the wall would vanish otherwise.
    pub fn predicted(logits: &[f32], octree: &Octree, input: &LightInput, max_count: usize) -> Self {
        let depth = octree.depth();
        let seen = |key: u32| input.visible.row(depth, key).is_some();
        // Observed nodes rank first; observed free space ranks last.
        let score = |(&logit, &key): (&f32, &u32)| match seen(key) {
            true => f32::INFINITY,
            false if input.free.contains_node(input.cube(), depth, key) => f32::NEG_INFINITY,
            false => logit,
        };
        let score: Vec<f32> = logits.par_iter().zip(&octree.levels()[depth as usize].keys).map(score).collect();
        let mut order: Vec<u32> = (0..score.len() as u32).filter(|&node| score[node as usize] > MIN_LOGIT).collect();
        // Siblings are contiguous. Families without a likely child are kept as a whole.
        if depth > octree.full_depth() {
            let unlikely = |scores: &[f32]| scores.iter().all(|&score| score <= MIN_LOGIT);
            let whole = score.chunks(8).enumerate().filter(|(_, scores)| unlikely(scores));
            let children = whole.flat_map(|(family, _)| 8 * family as u32..8 * (family as u32 + 1));
            order.extend(children.filter(|&child| score[child as usize] > f32::NEG_INFINITY));
        }
        let mut warning = None;
        if order.is_empty() {
            order.extend((0..score.len() as u32).max_by(|&a, &b| score[a as usize].total_cmp(&score[b as usize])));
            warning = Some(NetworkWarning::NothingOccupied { depth });
        }
        if order.len() > max_count {
            warning = Some(NetworkWarning::NodeBudget { depth, predicted: order.len(), kept: max_count });
            order.sort_by(|&a, &b| score[b as usize].total_cmp(&score[a as usize]));
            order.truncate(max_count);
        }
        let mut nonempty = vec![false; score.len()];
        order.iter().for_each(|&node| nonempty[node as usize] = true);
        Self { nonempty, warning }
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use lo_geometry::{Camera, Cube, Vec3};
    use lo_octree::{LightOctree, Provenance, RadiancePoint};

    use super::*;
    use crate::light::{LightNetConfig, VisiblePoint};

    /// Points observed by a camera at a corner of the cube. The rest of space is unobserved.
    fn input(points: &[Vec3]) -> LightInput {
        let point =
            |&position_m: &Vec3| VisiblePoint { position_m, radiance: [1.0; 3], normal: Vec3::ZERO, certain: true };
        let points: Vec<VisiblePoint> = points.iter().map(point).collect();
        let camera = Camera::from_hfov_deg(60.0, 8, 8).unwrap();
        let config = LightNetConfig { depth: 2, full_depth: 1, ..LightNetConfig::default() };
        LightInput::new(&points, &camera, Cube { origin_m: Vec3::ZERO, edge_m: 1.0 }, &config, 1).unwrap()
    }

    #[test]
    fn likeliest_and_observed_nodes_are_kept() {
        let octree = Octree::full(1).unwrap();
        let logits = [-5.0, 1.0, 3.0, -1.0, 2.0, 0.5, -2.0, -3.0];
        let occupancy = Occupancy::predicted(&logits, &octree, &input(&[Vec3::ZERO]), 8);
        assert_eq!(occupancy.nonempty, [true, true, true, false, true, true, false, false]);
        assert_eq!(occupancy.warning, None);
        let occupancy = Occupancy::predicted(&logits, &octree, &input(&[Vec3::ZERO]), 3);
        assert_eq!(occupancy.nonempty, [true, false, true, false, true, false, false, false]);
        assert_eq!(occupancy.warning, Some(NetworkWarning::NodeBudget { depth: 1, predicted: 5, kept: 3 }));
    }

    #[test]
    fn a_node_without_likely_children_stays_whole() {
        let mut octree = Octree::full(1).unwrap();
        octree.set_nonempty(&[true; 8]).unwrap();
        octree.grow(&[true, false, true, false, false, false, false, false]).unwrap();
        let mut logits = [-4.0; 16];
        logits[3] = 2.0;
        let occupancy = Occupancy::predicted(&logits, &octree, &input(&[]), usize::MAX);
        assert!((0..16).all(|node| occupancy.nonempty[node] == (node == 3 || node >= 8)), "{:?}", occupancy.nonempty);
    }

    #[test]
    fn budgets_are_shared_between_depths() {
        let full = |depth| Octree::full(depth).unwrap();
        // Nothing observed: 1 + 4 + 16 parts, then 1 + 4, then all.
        let nothing = full(7);
        assert_eq!(
            [(4, 2100), (5, 2000), (6, 1600)].map(|(depth, left)| max_splits(left, &nothing, depth, 7)),
            [100, 400, 1600]
        );
        // One observed node at each of the three depths.
        let point = RadiancePoint { position_m: Vec3::ZERO, radiance: [1.0; 3], provenance: Provenance::Observed };
        let cube = Cube { origin_m: Vec3::ZERO, edge_m: 1.0 };
        let seen = LightOctree::from_points(&[point], cube, 7, 4).unwrap().0.octree;
        assert_eq!(max_splits(2103, &seen, 4, 7), 101);
        assert_eq!([max_splits(2, &seen, 4, 7), max_splits(0, &seen, 6, 7)], [1, 1]);
    }

    #[test]
    fn at_least_one_node_is_kept() {
        let logits = [-1.0, -0.8, -3.0, -1.0, -1.0, -1.0, -1.0, -1.0];
        let occupancy = Occupancy::predicted(&logits, &Octree::full(1).unwrap(), &input(&[]), 8);
        assert_eq!(occupancy.nonempty.iter().position(|&label| label), Some(1));
        assert_eq!(occupancy.warning, Some(NetworkWarning::NothingOccupied { depth: 1 }));
    }
}
