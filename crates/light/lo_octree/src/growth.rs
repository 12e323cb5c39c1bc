//! Level-by-level growth of an octree by a network: [`Octree::full`], then [`Octree::set_nonempty`] and
//! [`Octree::grow`] in turn.

use crate::{Level, MAX_DEPTH, Octree, OctreeError};

impl Octree {
    /// Adds a level: the empty, unsplit children of the finest level's nodes for which `split` is true.
    ///
    /// # Errors
    /// `split` differs in length from the finest level, an empty node would be split, or the octree already has
    /// [`MAX_DEPTH`].
    pub fn grow(&mut self, split: &[bool]) -> Result<(), OctreeError> {
        let depth = self.depth();
        if depth >= MAX_DEPTH {
            return Err(OctreeError::Grow { depth });
        }
        let finest = &mut self.levels_mut()[depth as usize];
        check_length("split labels", finest.len(), split.len())?;
        if let Some(node) = (0..split.len()).find(|&node| split[node] && finest.rows[node] < 0) {
            return Err(OctreeError::Label { depth, node, what: "is empty, so it cannot be split" });
        }
        let mut keys = Vec::with_capacity(8 * split.iter().filter(|&&split| split).count());
        for (node, _) in split.iter().enumerate().filter(|(_, split)| **split) {
            finest.children[node] = keys.len() as i32;
            keys.extend((0..8).map(|child| finest.keys[node] << 3 | child));
        }
        self.levels_mut().push(Level::new(keys, false));
        Ok(())
    }

    /// Marks nodes of the finest level as non-empty and numbers their feature rows in node order.
    ///
    /// At the full depth, the levels above are updated: a node there is non-empty when one of its children is.
    ///
    /// # Errors
    /// `nonempty` differs in length from the finest level, or a node under an empty one would be non-empty.
    pub fn set_nonempty(&mut self, nonempty: &[bool]) -> Result<(), OctreeError> {
        let depth = self.depth();
        let full = depth == self.full_depth();
        let levels = self.levels_mut();
        let (above, finest) = levels.split_at_mut(depth as usize);
        check_length("non-empty labels", finest[0].len(), nonempty.len())?;
        if full {
            let mut labels = nonempty.to_vec();
            for level in above.iter_mut().rev() {
                labels = labels.as_chunks::<8>().0.iter().map(|family| family.contains(&true)).collect();
                level.number_rows(labels.iter().copied());
            }
        } else if let Some(parents) = above.last() {
            let parent_labels = (0..parents.len()).filter(|&p| parents.children[p] >= 0).map(|p| parents.rows[p] >= 0);
            let orphan =
                parent_labels.flat_map(|label| [label; 8]).zip(nonempty).position(|(parent, &label)| label && !parent);
            if let Some(node) = orphan {
                return Err(OctreeError::Label {
                    depth,
                    node,
                    what: "is under an empty node, so it cannot be non-empty",
                });
            }
        }
        finest[0].number_rows(nonempty.iter().copied());
        Ok(())
    }
}

fn check_length(what: &'static str, expected: usize, got: usize) -> Result<(), OctreeError> {
    if got == expected { Ok(()) } else { Err(OctreeError::Length { what, expected, got }) }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use lo_geometry::{Cube, Vec3};

    use super::*;
    use crate::{LightOctree, Provenance, RadiancePoint};

    #[test]
    fn growing_by_the_labels_of_an_octree_gives_that_octree() {
        let points: Vec<RadiancePoint> = (0..500)
            .map(|i| RadiancePoint {
                position_m: Vec3::new(0.5 + 0.4 * (i as f32).sin(), (i as f32 * 0.618).fract(), i as f32 / 500.0),
                radiance: [1.0; 3],
                provenance: Provenance::Observed,
            })
            .collect();
        let cube = Cube { origin_m: Vec3::ZERO, edge_m: 1.0 };
        let target = LightOctree::from_points(&points, cube, 7, 2).unwrap().0.octree;
        let mut grown = Octree::full(2).unwrap();
        for level in &target.levels()[2..] {
            grown.set_nonempty(&level.rows.iter().map(|&row| row >= 0).collect::<Vec<_>>()).unwrap();
            if grown.depth() < 7 {
                grown.grow(&level.children.iter().map(|&child| child >= 0).collect::<Vec<_>>()).unwrap();
            }
        }
        assert_eq!(grown, target);
    }

    #[test]
    fn growth_is_checked() {
        let mut octree = Octree::full(1).unwrap();
        assert_eq!(octree.grow(&[true; 7]), Err(OctreeError::Length { what: "split labels", expected: 8, got: 7 }));
        assert!(matches!(octree.grow(&[true; 8]), Err(OctreeError::Label { depth: 1, node: 0, .. })));
        octree.set_nonempty(&[false, false, true, true, false, false, false, false]).unwrap();
        for _ in 1..MAX_DEPTH {
            let finest = &octree.levels()[octree.depth() as usize];
            let last = finest.rows.iter().rposition(|&row| row >= 0).unwrap();
            let mut split = vec![false; finest.len()];
            split[last] = true;
            octree.grow(&split).unwrap();
            octree.set_nonempty(&[true; 8]).unwrap();
        }
        assert_eq!(octree.grow(&[false; 8]), Err(OctreeError::Grow { depth: MAX_DEPTH }));
    }

    #[test]
    fn a_network_may_split_nothing() {
        let mut octree = Octree::full(1).unwrap();
        octree.grow(&[false; 8]).unwrap();
        octree.set_nonempty(&[]).unwrap();
        octree.grow(&[]).unwrap();
        assert_eq!(octree.neighbours(3).len(), 0);
        assert_eq!(octree.find(3, 100), None);
    }
}
