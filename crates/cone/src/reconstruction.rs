use crate::grid::{EmptyBox, Found, Grid};

/// How the octree is read at a position between node centres.
pub(crate) trait Reconstruction {
    /// Value of the field at `position` (leaf edges) and `level`.
    fn read(grid: &Grid, position: [f32; 3], level: f32) -> Read;

    /// The slots that the value is made of and their weights: extinction is the weighted sum of theirs, radiance the mean
    /// weighted by extinction too.
    fn footprint(grid: &Grid, position: [f32; 3], level: f32, visit: impl FnMut(u32, f32));
}

/// What a sample finds.
pub(crate) enum Read {
    /// Linear RGB radiance and extinction per leaf edge.
    Value([f32; 4]),
    /// Nothing, nor anywhere else in the box.
    Empty(EmptyBox),
}

/// The node that contains the position, at the level rounded up.
pub(crate) struct Nearest;

/// Trilinear within a level, linear between the two levels around the sample's. Outside of the cube there is nothing.
pub(crate) struct Interpolated;

impl Reconstruction for Nearest {
    #[inline(always)]
    fn read(grid: &Grid, position: [f32; 3], level: f32) -> Read {
        match grid.find(leaf_cell(grid, position), level.ceil() as u32) {
            Found::Slot(slot) => Read::Value(grid.value(slot)),
            Found::Empty(empty) => Read::Empty(empty),
        }
    }

    #[inline(always)]
    fn footprint(grid: &Grid, position: [f32; 3], level: f32, mut visit: impl FnMut(u32, f32)) {
        if let Found::Slot(slot) = grid.find(leaf_cell(grid, position), level.ceil() as u32) {
            visit(slot, 1.0);
        }
    }
}

impl Reconstruction for Interpolated {
    #[inline(always)]
    fn read(grid: &Grid, position: [f32; 3], level: f32) -> Read {
        // The eight nodes around a position are its own and neighbours: with two cells of nothing around it, all are empty.
        if let Found::Empty(empty) = grid.find(leaf_cell(grid, position), level.ceil() as u32)
            && let Some(inner) = empty.shrunk()
        {
            return Read::Empty(inner);
        }
        let mut sum = [0.0; 4];
        Self::footprint(grid, position, level, |slot, weight| {
            let [r, g, b, extinction] = grid.value(slot);
            let extinction = weight * extinction;
            sum = [sum[0] + extinction * r, sum[1] + extinction * g, sum[2] + extinction * b, sum[3] + extinction];
        });
        let [r, g, b, extinction] = sum;
        let scale = if extinction > 0.0 { 1.0 / extinction } else { 0.0 };
        Read::Value([r * scale, g * scale, b * scale, extinction])
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
        if let Found::Slot(slot) = grid.find(cell.map(|c| c << level), level) {
            let weight: f32 =
                (0..3).map(|axis| if offset[axis] == 1 { fraction[axis] } else { 1.0 - fraction[axis] }).product();
            visit(slot, weight);
        }
    }
}

/// The leaf cell of a position; rounding may have put it on the far side of a face of the cube.
#[inline(always)]
fn leaf_cell(grid: &Grid, position: [f32; 3]) -> [i32; 3] {
    position.map(|p| (p as i32).clamp(0, grid.side() - 1))
}
