use crate::grid::{Cell, Grid};

/// How the octree is read at a position between node centres.
pub(crate) trait Reconstruction {
    /// How many cells around its own a sample reads.
    const RADIUS: i32;

    /// Linear RGB radiance and extinction per leaf edge at `position` (leaf edges) and `level`; `cell` is what lies there at
    /// the level rounded up.
    fn read(grid: &Grid, cell: Cell, position: [f32; 3], level: f32) -> [f32; 4];

    /// The slots that the value is made of and their weights: extinction is the weighted sum of theirs, radiance the mean
    /// weighted by extinction too.
    fn footprint(grid: &Grid, position: [f32; 3], level: f32, visit: impl FnMut(u32, f32));
}

/// The node that contains the position, at the level rounded up.
pub(crate) struct Nearest;

/// Trilinear within a level, linear between the two levels around the sample's. Outside of the cube there is nothing.
pub(crate) struct Interpolated;

impl Reconstruction for Nearest {
    const RADIUS: i32 = 0;

    #[inline(always)]
    fn read(grid: &Grid, cell: Cell, _: [f32; 3], _: f32) -> [f32; 4] {
        match cell {
            Cell::Slot(slot) => grid.value(slot),
            Cell::Empty { .. } => [0.0; 4],
        }
    }

    #[inline(always)]
    fn footprint(grid: &Grid, position: [f32; 3], level: f32, mut visit: impl FnMut(u32, f32)) {
        let leaf = position.map(|p| (p as i32).clamp(0, grid.side() - 1));
        if let Cell::Slot(slot) = grid.find(leaf, level.ceil() as u32) {
            visit(slot, 1.0);
        }
    }
}

impl Reconstruction for Interpolated {
    /// The eight nodes around a position are its own and neighbours.
    const RADIUS: i32 = 1;

    #[inline(always)]
    fn read(grid: &Grid, _: Cell, position: [f32; 3], level: f32) -> [f32; 4] {
        let mut sum = [0.0; 4];
        Self::footprint(grid, position, level, |slot, weight| {
            let [r, g, b, extinction] = grid.value(slot);
            let extinction = weight * extinction;
            sum = [sum[0] + extinction * r, sum[1] + extinction * g, sum[2] + extinction * b, sum[3] + extinction];
        });
        let [r, g, b, extinction] = sum;
        let scale = if extinction > 0.0 { 1.0 / extinction } else { 0.0 };
        [r * scale, g * scale, b * scale, extinction]
    }

    #[inline(always)]
    fn footprint(grid: &Grid, position: [f32; 3], level: f32, mut visit: impl FnMut(u32, f32)) {
        let fine = level as u32;
        let blend = level - fine as f32;
        trilinear(grid, position, fine, |slot, weight| visit(slot, weight * (1.0 - blend)));
        if blend > 0.0 {
            trilinear(grid, position, fine + 1, |slot, weight| visit(slot, weight * blend));
        }
    }
}

#[inline(always)]
fn trilinear(grid: &Grid, position: [f32; 3], level: u32, mut visit: impl FnMut(u32, f32)) {
    let edge = (1u32 << level) as f32;
    let mut base = [0i32; 3];
    let mut fraction = [0f32; 3];
    for axis in 0..3 {
        let p = position[axis] / edge - 0.5;
        base[axis] = p.floor() as i32;
        fraction[axis] = p - base[axis] as f32;
    }
    let side = grid.side() >> level;
    for corner in 0..8 {
        let offset = [corner >> 2 & 1, corner >> 1 & 1, corner & 1];
        let cell: [i32; 3] = std::array::from_fn(|axis| base[axis] + offset[axis]);
        if cell.iter().any(|c| !(0..side).contains(c)) {
            continue;
        }
        if let Cell::Slot(slot) = grid.find(cell.map(|c| c << level), level) {
            let weight: f32 =
                (0..3).map(|axis| if offset[axis] == 1 { fraction[axis] } else { 1.0 - fraction[axis] }).product();
            visit(slot, weight);
        }
    }
}
