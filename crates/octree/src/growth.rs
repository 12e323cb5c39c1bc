//! Octrees that a network makes, level by level: `full`, then `set_nonempty` and `grow` for each depth.

use crate::{Level, MAX_DEPTH, Octree, OctreeError};

impl Octree {
    /// Adds a level: the children, empty and unsplit, of the finest level's nodes for which `split` is true.
    ///
    /// # Errors
    /// `split` has another length than the finest level, or the octree has [`MAX_DEPTH`] already.
    pub fn grow(&mut self, split: &[bool]) -> Result<(), OctreeError> {
        let depth = self.depth();
        let finest = match self.level_mut(depth) {
            Some(finest) if depth < MAX_DEPTH => finest,
            _ => return Err(OctreeError::Grow { depth }),
        };
        check_length("split labels", finest.len(), split.len())?;
        let mut keys = Vec::with_capacity(8 * split.iter().filter(|&&s| s).count());
        for (node, _) in split.iter().enumerate().filter(|(_, split)| **split) {
            finest.children[node] = keys.len() as i32;
            keys.extend((0..8).map(|child| finest.keys[node] << 3 | child));
        }
        self.push(Level::new(keys, false));
        Ok(())
    }

    /// Says which nodes of level `depth` are non-empty, and numbers their feature rows in node order.
    ///
    /// # Errors
    /// There is no such level, or `nonempty` has another length than it.
    pub fn set_nonempty(&mut self, depth: u32, nonempty: &[bool]) -> Result<(), OctreeError> {
        let finest = self.depth();
        let level = self.level_mut(depth).ok_or(OctreeError::NoLevel { depth, finest })?;
        check_length("non-empty labels", level.len(), nonempty.len())?;
        level.number_rows(nonempty.iter().copied());
        Ok(())
    }
}

fn check_length(what: &'static str, expected: usize, got: usize) -> Result<(), OctreeError> {
    if got == expected { Ok(()) } else { Err(OctreeError::Length { what, expected, got }) }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use geometry::{Cube, Vec3};

    use super::*;
    use crate::{Coverage, LightOctree, RadiancePoint};

    #[test]
    fn growing_by_the_labels_of_an_octree_gives_that_octree() {
        let points: Vec<RadiancePoint> = (0..500)
            .map(|i| RadiancePoint {
                position_m: Vec3::new(0.5 + 0.4 * (i as f32).sin(), (i as f32 * 0.618).fract(), i as f32 / 500.0),
                radiance: [1.0; 3],
                coverage: Coverage::Seen,
            })
            .collect();
        let cube = Cube { origin_m: Vec3::ZERO, edge_m: 1.0 };
        let target = LightOctree::from_points(&points, cube, 7, 2).unwrap().0.octree;
        let mut grown = Octree::full(2).unwrap();
        for depth in 0..=7 {
            let level = &target.levels()[depth as usize];
            grown.set_nonempty(depth, &level.rows.iter().map(|&row| row >= 0).collect::<Vec<_>>()).unwrap();
            if (2..7).contains(&depth) {
                grown.grow(&level.children.iter().map(|&child| child >= 0).collect::<Vec<_>>()).unwrap();
            }
        }
        assert_eq!(grown, target);
    }

    #[test]
    fn growth_is_checked() {
        let mut octree = Octree::full(1).unwrap();
        assert_eq!(octree.grow(&[true; 7]), Err(OctreeError::Length { what: "split labels", expected: 8, got: 7 }));
        assert_eq!(octree.set_nonempty(2, &[]), Err(OctreeError::NoLevel { depth: 2, finest: 1 }));
        for _ in 1..MAX_DEPTH {
            let mut split = vec![false; octree.levels()[octree.depth() as usize].len()];
            split[3] = true;
            octree.grow(&split).unwrap();
        }
        assert_eq!(octree.grow(&[false; 8]), Err(OctreeError::Grow { depth: MAX_DEPTH }));
        // A level without nodes is allowed: a network may split nothing.
        let mut nothing = Octree::full(0).unwrap();
        nothing.grow(&[false]).unwrap();
        nothing.grow(&[]).unwrap();
        assert_eq!(nothing.neighbours(2).len(), 0);
    }
}
