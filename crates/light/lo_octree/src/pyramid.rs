//! Upper levels of a lighting octree, computed from its leaves.
//!
//! Colour is the mean of the children weighted by their opacity. Opacity is that of *crossing* the node. Along one axis
//! a node has four columns of two children each, and a column transmits `(1 − α₁)(1 − α₂)`. The axis with the greatest
//! opacity counts, since the mean of the axes (or of the children) makes a wall one leaf thick transparent from afar.
//!
//! This alone still leaks where a wall is not aligned with the axes: the wall leaves a node through one side and
//! continues in the next. Each of the two nodes is half open and together they are closed, but the product of two
//! halves is not zero. So a node that is mostly surface includes the continuation: columns are extended by the adjacent
//! child of the neighbours before and behind. Poles, edges and scattered leaves keep their size. `tests/it/opacity.rs`
//! measures both.

use rayon::prelude::*;

use crate::{Level, MAX_ALPHA, Neighbours, Octree, leaves::Leaves};

/// Leaves of one depth.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct LeafRows {
    /// Shuffled keys, strictly increasing.
    pub keys: Vec<u32>,
    /// Linear RGB radiance (finite, not negative) and opacity in [0, 1].
    pub rgba: Vec<[f32; 4]>,
    /// Observed share, 0 to 255.
    pub seen: Vec<u8>,
}

/// Content of a node above the leaves.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Ancestor {
    /// Colour, opacity and observed share merged from the children, as in [`LightOctree::from_points`](crate::LightOctree::from_points).
    Merged,
    /// Colour and observed share merged from the children, with this opacity.
    Opacity(f32),
    /// This RGBα and observed share.
    Known([f32; 4], u8),
}

/// Opacity along an axis from which a node counts as part of a surface across it. A thin pole blocks a quarter of the
/// columns of a large node and stays below. Of two nodes that share a slanted wall, one has at least half of it and is
/// above.
const SURFACE_OPACITY: f32 = 0.3;

/// Computes RGBα and observed share of the rows of every level, root first.
pub(crate) fn pyramid(octree: &Octree, leaves: Leaves) -> (Vec<Vec<[f32; 4]>>, Vec<Vec<u8>>) {
    let tables = octree.neighbour_tables(octree.depth() as usize);
    let (mut rgba, mut seen) = (vec![leaves.rgba], vec![leaves.seen]);
    for (depth, table) in tables.iter().enumerate().rev() {
        let family = Family {
            level: &octree.levels()[depth],
            below: &octree.levels()[depth + 1],
            rgba: &rgba[rgba.len() - 1],
            seen: &seen[seen.len() - 1],
            leaf_alpha: &[],
        };
        let nonempty: Vec<usize> = (0..table.len()).filter(|&node| family.level.rows[node] >= 0).collect();
        let rows: Vec<([f32; 4], u8)> =
            nonempty.par_iter().with_min_len(256).map(|&node| family.merged(node, &table[node])).collect();
        let (level_rgba, level_seen) = rows.into_iter().unzip();
        rgba.push(level_rgba);
        seen.push(level_seen);
    }
    rgba.reverse();
    seen.reverse();
    (rgba, seen)
}

/// Computes RGBα and observed share of the rows of every level, root first, for leaves `leaves[d]` of depth `d`.
/// `ancestor` defines the content of all other nodes.
pub(crate) fn pyramid_by_depth(
    octree: &Octree,
    leaves: Vec<LeafRows>,
    ancestor: impl Fn(u32, u32) -> Ancestor + Sync,
) -> (Vec<Vec<[f32; 4]>>, Vec<Vec<u8>>) {
    let tables = octree.neighbour_tables(leaves.len());
    let (mut rgba, mut seen) = (Vec::<Vec<[f32; 4]>>::new(), Vec::<Vec<u8>>::new());
    let none = (Level::default(), Vec::new(), Vec::new());
    for (depth, leaves) in leaves.into_iter().enumerate().rev() {
        let level = &octree.levels()[depth];
        let nonempty: Vec<usize> = (0..level.len()).filter(|&node| level.rows[node] >= 0).collect();
        // Number of a leaf among the leaves of its depth, in node order.
        let mut numbers = vec![usize::MAX; level.len()];
        let mut leaf_alpha = vec![0.0; level.len()];
        for (number, &node) in nonempty.iter().filter(|&&node| level.children[node] < 0).enumerate() {
            numbers[node] = number;
            leaf_alpha[node] = leaves.rgba[number][3];
        }
        let family = Family {
            level,
            below: octree.levels().get(depth + 1).unwrap_or(&none.0),
            rgba: rgba.last().unwrap_or(&none.1),
            seen: seen.last().unwrap_or(&none.2),
            leaf_alpha: &leaf_alpha,
        };
        let row = |&node: &usize| match leaves.rgba.get(numbers[node]) {
            Some(&rgba) => (rgba, leaves.seen[numbers[node]]),
            None => match ancestor(depth as u32, level.keys[node]) {
                Ancestor::Known(rgba, seen) => (rgba, seen),
                Ancestor::Merged => family.merged(node, &tables[depth][node]),
                Ancestor::Opacity(alpha) => {
                    let ([r, g, b, _], seen) = family.merged(node, &tables[depth][node]);
                    ([r, g, b, alpha], seen)
                }
            },
        };
        let (level_rgba, level_seen) = nonempty.par_iter().with_min_len(256).map(row).unzip();
        rgba.push(level_rgba);
        seen.push(level_seen);
    }
    rgba.reverse();
    seen.reverse();
    (rgba, seen)
}

/// A level and the features of the one below it.
struct Family<'a> {
    level: &'a Level,
    below: &'a Level,
    rgba: &'a [[f32; 4]],
    seen: &'a [u8],
    /// Opacity of the nodes of this level that are leaves, 0 for others; empty where all leaves are finer.
    leaf_alpha: &'a [f32],
}

impl Family<'_> {
    /// Returns RGBα and observed share of a non-empty split node.
    fn merged(&self, node: usize, neighbours: &Neighbours) -> ([f32; 4], u8) {
        let mut alpha = [0.0f32; 8];
        // premultiplied and plain sums of the colour
        let (mut premultiplied, mut plain) = ([0.0f64; 3], [0.0f64; 3]);
        let (mut weight, mut seen, mut count) = (0.0, 0, 0);
        for (child, alpha) in alpha.iter_mut().enumerate() {
            let Some(row) = self.child_row(node as i32, child) else { continue };
            let [r, g, b, a] = self.rgba[row];
            *alpha = a;
            for (channel, value) in [r, g, b].map(f64::from).into_iter().enumerate() {
                premultiplied[channel] += f64::from(a) * value;
                plain[channel] += value;
            }
            weight += f64::from(a);
            seen += u32::from(self.seen[row]);
            count += 1;
        }
        // Invisible children still have a colour, which a later change of opacity may show.
        let [r, g, b] = if weight > 0.0 {
            premultiplied.map(|sum| (sum / weight) as f32)
        } else {
            plain.map(|sum| (sum / f64::from(count)) as f32)
        };
        let seen = (seen + count / 2) / count;
        ([r, g, b, self.crossing_opacity(&alpha, neighbours)], seen as u8)
    }

    /// Returns the greatest opacity along an axis of a node whose children have the opacities `alpha`.
    fn crossing_opacity(&self, alpha: &[f32; 8], neighbours: &Neighbours) -> f32 {
        // bit of a child's number and distance in the neighbour table, for x, y, z
        let along = |(bit, stride): (usize, usize)| {
            let near_children = || (0..8).filter(|child| child & bit == 0);
            let columns = near_children().map(|near| (1.0 - alpha[near]) * (1.0 - alpha[near | bit]));
            let opacity = 1.0 - 0.25 * columns.clone().sum::<f32>();
            if opacity < SURFACE_OPACITY {
                return opacity;
            }
            let (before, behind) = (neighbours[13 - stride], neighbours[13 + stride]);
            let extended = columns.zip(near_children()).map(|(column, near)| {
                column * (1.0 - self.child_alpha(before, near | bit)) * (1.0 - self.child_alpha(behind, near))
            });
            1.0 - 0.25 * extended.sum::<f32>()
        };
        [(4, 9), (2, 3), (1, 1)].map(along).into_iter().fold(0.0, f32::max).min(MAX_ALPHA)
    }

    /// Returns the opacity of a child; a leaf is crossed with its own opacity.
    fn child_alpha(&self, node: i32, child: usize) -> f32 {
        let of_leaf = || usize::try_from(node).ok().and_then(|node| self.leaf_alpha.get(node)).copied().unwrap_or(0.0);
        self.child_row(node, child).map_or_else(of_leaf, |row| self.rgba[row][3])
    }

    /// Returns the feature row of a child, if node (−1 for none) and child exist and the child is not empty.
    fn child_row(&self, node: i32, child: usize) -> Option<usize> {
        let first = *self.level.children.get(usize::try_from(node).ok()?)?;
        usize::try_from(self.below.rows[usize::try_from(first).ok()? + child]).ok()
    }
}
