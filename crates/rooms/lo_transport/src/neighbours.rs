//! Surfels near a point.

use lo_geometry::Vec3;

/// Interpolation weights of surfels at a point.
#[derive(Clone, Copy)]
pub(crate) struct Neighbours {
    entries: [(u32, f32); Self::MAX_ENTRIES],
    count: usize,
    /// Whether the surfels belong to other components, because the point's own component has none nearby.
    pub from_other_components: bool,
}

impl Neighbours {
    const MAX_ENTRIES: usize = 24;

    /// Creates an empty set.
    pub(crate) fn none() -> Self {
        Self { entries: [(0, 0.0); Self::MAX_ENTRIES], count: 0, from_other_components: false }
    }

    pub(crate) fn as_slice(&self) -> &[(u32, f32)] {
        &self.entries[..self.count]
    }

    pub(crate) fn push(&mut self, surfel: u32, weight: f32) {
        if self.count < Self::MAX_ENTRIES {
            self.entries[self.count] = (surfel, weight);
            self.count += 1;
        }
    }

    /// Returns the surfel with the largest weight.
    pub(crate) fn best(&self) -> Option<u32> {
        self.as_slice().iter().copied().reduce(|a, b| if b.1 > a.1 { b } else { a }).map(|(surfel, _)| surfel)
    }

    /// Returns the weighted mean of `value` over the surfels.
    pub(crate) fn mean(&self, value: impl Fn(usize) -> Vec3) -> Vec3 {
        weighted_mean(self.as_slice(), value)
    }
}

/// Returns the weighted mean of `value`, or 0 without entries.
pub(crate) fn weighted_mean(entries: &[(u32, f32)], value: impl Fn(usize) -> Vec3) -> Vec3 {
    let (mut sum, mut weights) = (Vec3::ZERO, 0.0);
    for &(surfel, weight) in entries {
        sum += value(surfel as usize) * weight;
        weights += weight;
    }
    if weights > 0.0 { sum / weights } else { Vec3::ZERO }
}
