//! Refinement of the surfel spacing where light changes quickly: near lamps and inside lamp shades.

use lo_geometry::Vec3;
use lo_mesh::Model;
use rustc_hash::FxHashMap;

use crate::lights::{Emitter, EmitterShape, Emitters};

/// Target spacing as a share of the distance to the nearest lamp.
const DISTANCE_SHARE: f32 = 0.5;

/// Maximum number of halvings of the spacing.
pub(crate) const MAX_LEVELS: u32 = 3;

/// Grid cells per spacing.
const CELLS: f32 = 2.0;

/// Triangles that cover more cells are not tested cell by cell.
const MAX_CELLS: i32 = 64;

/// Number of halvings of the spacing, per grid cell.
pub(crate) struct Refinement {
    spacing_m: f32,
    levels: FxHashMap<[i32; 3], u32>,
}

impl Refinement {
    /// Creates a uniform spacing.
    pub(crate) fn uniform(spacing_m: f32) -> Self {
        Self { spacing_m, levels: FxHashMap::default() }
    }

    /// Creates a spacing that is refined around all lamps.
    pub(crate) fn around_lamps(emitters: &Emitters, spacing_m: f32) -> Self {
        let mut refinement = Self::uniform(spacing_m);
        let (cell_m, reach) = (spacing_m / CELLS, (CELLS / DISTANCE_SHARE).ceil() as i32);
        let offsets: Vec<([i32; 3], u32)> = cells_in_box([-reach; 3], [reach; 3])
            .map(|offset| (offset, Vec3::from(offset.map(|v| v as f32)).length() * cell_m))
            .map(|(offset, distance_m)| (offset, level(spacing_m, distance_m)))
            .filter(|(_, level)| *level > 0)
            .collect();
        for cell in refinement.lamp_cells(emitters) {
            for &(offset, level) in &offsets {
                let at = [0, 1, 2].map(|axis| cell[axis] + offset[axis]);
                let found = refinement.levels.entry(at).or_default();
                *found = level.max(*found);
            }
        }
        refinement
    }

    /// Returns the cells that lamps may occupy.
    fn lamp_cells(&self, emitters: &Emitters) -> Vec<[i32; 3]> {
        let is_lamp = |emitter: &&Emitter| emitter.shape != EmitterShape::Portal && !emitter.sheet;
        let cells = |emitter: &Emitter| {
            let corners = emitter.corners();
            let low = corners.into_iter().fold(Vec3::INFINITY, Vec3::min);
            let high = corners.into_iter().fold(Vec3::NEG_INFINITY, Vec3::max);
            cells_in_box(self.cell(low), self.cell(high))
        };
        let mut all: Vec<[i32; 3]> = emitters.list.iter().filter(is_lamp).flat_map(cells).collect();
        all.sort_unstable();
        all.dedup();
        all
    }

    fn cell(&self, position: Vec3) -> [i32; 3] {
        (position * (CELLS / self.spacing_m)).floor().to_array().map(|v| v as i32)
    }

    /// Returns the number of halvings at a position.
    pub(crate) fn level_at(&self, position: Vec3) -> u32 {
        if self.levels.is_empty() {
            return 0;
        }
        self.levels.get(&self.cell(position)).copied().unwrap_or(0)
    }

    /// Returns the spacing after `level` halvings, in metres.
    pub(crate) fn spacing_m(&self, level: u32) -> f32 {
        self.spacing_m / (1 << level) as f32
    }

    /// Returns an upper bound of [`Refinement::level_at`] on a triangle.
    pub(crate) fn max_level_on(&self, model: &Model, triangle: u32) -> u32 {
        if self.levels.is_empty() {
            return 0;
        }
        let corners = model.triangles[triangle as usize].map(|v| model.positions[v as usize]);
        let low = self.cell(corners.into_iter().fold(Vec3::INFINITY, Vec3::min));
        let high = self.cell(corners.into_iter().fold(Vec3::NEG_INFINITY, Vec3::max));
        let count = [0, 1, 2].map(|axis| high[axis].saturating_sub(low[axis]).saturating_add(1));
        if count.into_iter().fold(1, i32::saturating_mul) > MAX_CELLS {
            return MAX_LEVELS;
        }
        cells_in_box(low, high).filter_map(|cell| self.levels.get(&cell).copied()).max().unwrap_or(0)
    }
}

/// Returns the number of halvings at a distance from a lamp.
fn level(spacing_m: f32, distance_m: f32) -> u32 {
    let halvings = (spacing_m / (DISTANCE_SHARE * distance_m)).log2().ceil();
    halvings.clamp(0.0, MAX_LEVELS as f32) as u32
}

/// Iterates over the cells of a box, including both ends.
fn cells_in_box(low: [i32; 3], high: [i32; 3]) -> impl Iterator<Item = [i32; 3]> {
    let along = move |axis: usize| low[axis]..=high[axis];
    along(0).flat_map(move |x| along(1).flat_map(move |y| along(2).map(move |z| [x, y, z])))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn spacing_is_at_most_half_of_the_distance_until_the_finest() {
        for step in 1..200 {
            let distance_m = step as f32 * 0.005;
            let level = level(0.14, distance_m);
            let spacing_m = 0.14 / (1 << level) as f32;
            assert!(spacing_m <= 0.5 * distance_m || level == MAX_LEVELS, "{distance_m} m");
            assert!(level == 0 || 2.0 * spacing_m > 0.5 * distance_m, "{distance_m} m");
        }
    }
}
