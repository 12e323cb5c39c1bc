//! Neighbourhoods of all surfels.

use lo_geometry::Vec3;
use rayon::prelude::*;

use crate::neighbours::weighted_mean;
use crate::surfels::Surfels;

/// Neighbours of each surfel, including itself. Found once, used by many filter passes.
pub(crate) struct Neighbourhoods {
    /// Start of each surfel's entries: surfel `i` has `entries[first[i]..first[i + 1]]`.
    first: Vec<u32>,
    entries: Vec<(u32, f32)>,
}

impl Neighbourhoods {
    pub(crate) fn new(surfels: &Surfels) -> Self {
        let near: Vec<Vec<(u32, f32)>> = surfels
            .list
            .par_iter()
            .map(|surfel| surfels.near(surfel.position, surfel.normal, surfel.component).as_slice().to_vec())
            .collect();
        let mut first = vec![0];
        first.extend(near.iter().scan(0, |sum, entries| {
            *sum += entries.len() as u32;
            Some(*sum)
        }));
        Self { first, entries: near.concat() }
    }

    /// Returns the neighbours of surfel `i` with their weights.
    pub(crate) fn of(&self, i: usize) -> &[(u32, f32)] {
        &self.entries[self.first[i] as usize..self.first[i + 1] as usize]
    }

    /// Returns the weighted mean of the neighbours' values.
    pub(crate) fn mean(&self, i: usize, values: &[Vec3]) -> Vec3 {
        weighted_mean(self.of(i), |surfel| values[surfel])
    }
}
