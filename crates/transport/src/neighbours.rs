//! Surfels near a place, and near each other.

use geometry::Vec3;
use rayon::prelude::*;

use crate::surfels::Surfels;

/// Weights of surfels at a place.
#[derive(Clone, Copy)]
pub(crate) struct Neighbours {
    entries: [(u32, f32); Self::MOST],
    count: usize,
    /// Found among surfels of other parts, as the place's own part has none there.
    pub of_others: bool,
}

impl Neighbours {
    const MOST: usize = 24;

    /// None yet.
    pub(crate) fn none() -> Self {
        Self { entries: [(0, 0.0); Self::MOST], count: 0, of_others: false }
    }

    pub(crate) fn as_slice(&self) -> &[(u32, f32)] {
        &self.entries[..self.count]
    }

    pub(crate) fn push(&mut self, surfel: u32, weight: f32) {
        if self.count < Self::MOST {
            self.entries[self.count] = (surfel, weight);
            self.count += 1;
        }
    }

    /// The surfel that counts most.
    pub(crate) fn best(&self) -> Option<u32> {
        self.as_slice().iter().copied().reduce(|a, b| if b.1 > a.1 { b } else { a }).map(|(surfel, _)| surfel)
    }

    /// Weighted mean of what `value` gives for each surfel.
    pub(crate) fn mean(&self, value: impl Fn(usize) -> Vec3) -> Vec3 {
        weighted_mean(self.as_slice(), value)
    }
}

/// The neighbours of each surfel, itself among them, found once for many passes.
pub(crate) struct Neighbourhoods {
    /// Surfel `i` has `entries[first[i]..first[i + 1]]`.
    first: Vec<u32>,
    entries: Vec<(u32, f32)>,
}

impl Neighbourhoods {
    pub(crate) fn new(surfels: &Surfels) -> Self {
        let near: Vec<Vec<(u32, f32)>> = surfels
            .list
            .par_iter()
            .map(|surfel| surfels.near(surfel.position, surfel.normal, surfel.part).as_slice().to_vec())
            .collect();
        let mut first = vec![0];
        first.extend(near.iter().scan(0, |sum, entries| {
            *sum += entries.len() as u32;
            Some(*sum)
        }));
        Self { first, entries: near.concat() }
    }

    /// Neighbours of surfel `i` with their weights.
    pub(crate) fn of(&self, i: usize) -> &[(u32, f32)] {
        &self.entries[self.first[i] as usize..self.first[i + 1] as usize]
    }

    /// Weighted mean of the neighbours' values.
    pub(crate) fn mean(&self, i: usize, values: &[Vec3]) -> Vec3 {
        weighted_mean(self.of(i), |surfel| values[surfel])
    }
}

fn weighted_mean(entries: &[(u32, f32)], value: impl Fn(usize) -> Vec3) -> Vec3 {
    let (mut sum, mut weights) = (Vec3::ZERO, 0.0);
    for &(surfel, weight) in entries {
        sum += value(surfel as usize) * weight;
        weights += weight;
    }
    if weights > 0.0 { sum / weights } else { Vec3::ZERO }
}
