//! Radiance on a rectangle, filled in from known cells.

use lo_geometry::Vec2;

/// A grid of radiance over one face of the room, cell centres at +0.5.
#[derive(Clone, Debug)]
pub(crate) struct FaceGrid {
    width: usize,
    height: usize,
    /// Weighted radiance and weight of each cell.
    cells: Vec<[f32; 4]>,
}

impl FaceGrid {
    /// An empty grid.
    pub fn new(width: usize, height: usize) -> Self {
        let (width, height) = (width.max(1), height.max(1));
        Self { width, height, cells: vec![[0.0; 4]; width * height] }
    }

    /// Returns the number of cells along both sides.
    pub fn size(&self) -> (usize, usize) {
        (self.width, self.height)
    }

    fn index(&self, at: Vec2) -> usize {
        let x = ((at.x * self.width as f32) as usize).min(self.width - 1);
        let y = ((at.y * self.height as f32) as usize).min(self.height - 1);
        y * self.width + x
    }

    /// Adds a sample at `at` in [0, 1]²; a cell with a weight of 1 or more counts as fully known.
    pub fn add(&mut self, at: Vec2, radiance: [f32; 3], weight: f32) {
        let index = self.index(at);
        let cell = &mut self.cells[index];
        for c in 0..3 {
            cell[c] += weight * radiance[c];
        }
        cell[3] += weight;
    }

    /// Adds radiance to every cell of a filled grid, as a function of the cell's centre in [0, 1]².
    pub fn brighten(&mut self, mut extra: impl FnMut(Vec2) -> [f32; 3]) {
        for y in 0..self.height {
            for x in 0..self.width {
                let at = Vec2::new((x as f32 + 0.5) / self.width as f32, (y as f32 + 0.5) / self.height as f32);
                let extra = extra(at);
                let cell = &mut self.cells[y * self.width + x];
                for c in 0..3 {
                    cell[c] += cell[3] * extra[c];
                }
            }
        }
    }

    /// Fills every cell by pull-push (Gortler et al. 1996). Known cells keep their value; the others smoothly take that
    /// of the finest coarser level with a known value. `prior` has the weight `prior_weight`, in cells.
    pub fn fill(&mut self, prior: [f32; 3], prior_weight: f32) {
        let mut levels = vec![Level { width: self.width, height: self.height, cells: self.saturated() }];
        while levels[levels.len() - 1].cells.len() > 1 {
            let finer = &levels[levels.len() - 1];
            levels.push(finer.halved());
        }
        let top = levels.len() - 1;
        let cell = &mut levels[top].cells[0];
        for c in 0..3 {
            cell[c] = (cell[c] + prior_weight * prior[c]) / (cell[3] + prior_weight).max(1e-12);
        }
        cell[3] = 1.0;
        for fine in (0..top).rev() {
            let (lower, upper) = levels.split_at_mut(fine + 1);
            lower[fine].blend(&upper[0]);
        }
        self.cells = levels.swap_remove(0).cells;
    }

    /// Returns the means of the cells, with weights of at most 1.
    fn saturated(&self) -> Vec<[f32; 4]> {
        self.cells.iter().map(|cell| cell.map(|c| c / cell[3].max(1.0))).collect()
    }

    /// Returns the bilinear radiance at `at` in [0, 1]² of a filled grid.
    pub fn sample(&self, at: Vec2) -> [f32; 3] {
        let x = (at.x * self.width as f32 - 0.5).clamp(0.0, (self.width - 1) as f32);
        let y = (at.y * self.height as f32 - 0.5).clamp(0.0, (self.height - 1) as f32);
        bilinear(&self.cells, self.width, self.height, x, y)
    }
}

/// A level of the pyramid: weighted radiance and weight on the way up, radiance with weight 1 on the way down.
struct Level {
    width: usize,
    height: usize,
    cells: Vec<[f32; 4]>,
}

impl Level {
    /// Sums 2 × 2 cells. The weight saturates at 1, so that a fully known coarse cell does not outvote finer ones.
    fn halved(&self) -> Self {
        let (width, height) = (self.width.div_ceil(2), self.height.div_ceil(2));
        let mut cells = vec![[0.0f32; 4]; width * height];
        for y in 0..self.height {
            for x in 0..self.width {
                let cell = &mut cells[y / 2 * width + x / 2];
                let from = self.cells[y * self.width + x];
                for c in 0..4 {
                    cell[c] += from[c];
                }
            }
        }
        for cell in &mut cells {
            let scale = cell[3].min(1.0) / cell[3].max(1e-12);
            *cell = cell.map(|c| c * scale);
        }
        Self { width, height, cells }
    }

    /// Blends each cell with the coarser level's value by its missing weight.
    fn blend(&mut self, coarser: &Self) {
        for y in 0..self.height {
            for x in 0..self.width {
                let cell = &mut self.cells[y * self.width + x];
                if cell[3] < 1.0 {
                    let u = ((x as f32 + 0.5) * 0.5 - 0.5).clamp(0.0, (coarser.width - 1) as f32);
                    let v = ((y as f32 + 0.5) * 0.5 - 0.5).clamp(0.0, (coarser.height - 1) as f32);
                    let behind = bilinear(&coarser.cells, coarser.width, coarser.height, u, v);
                    for c in 0..3 {
                        cell[c] += (1.0 - cell[3]) * behind[c];
                    }
                    cell[3] = 1.0;
                }
            }
        }
    }
}

fn bilinear(cells: &[[f32; 4]], width: usize, height: usize, x: f32, y: f32) -> [f32; 3] {
    let (x0, y0) = (x as usize, y as usize);
    let (x1, y1) = ((x0 + 1).min(width - 1), (y0 + 1).min(height - 1));
    let (fx, fy) = (x - x0 as f32, y - y0 as f32);
    std::array::from_fn(|c| {
        let row = |y: usize| cells[y * width + x0][c] * (1.0 - fx) + cells[y * width + x1][c] * fx;
        row(y0) * (1.0 - fy) + row(y1) * fy
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn known_cells_stay_and_unknown_ones_lie_between() {
        let mut grid = FaceGrid::new(33, 17);
        for y in 0..17 {
            let v = (y as f32 + 0.5) / 17.0;
            grid.add(Vec2::new(0.01, v), [1.0, 0.0, 0.5], 3.0);
            grid.add(Vec2::new(0.99, v), [0.0, 1.0, 0.5], 3.0);
        }
        grid.fill([9.0; 3], 1e-3);
        assert!((grid.sample(Vec2::new(0.0, 0.5))[0] - 1.0).abs() < 1e-5);
        let mut last = 1.1;
        for x in 0..33 {
            let value = grid.sample(Vec2::new((x as f32 + 0.5) / 33.0, 0.5));
            // Constant channels stay constant, and the red one decreases from left to right (with slight ringing of the
            // pyramid).
            assert!((value[2] - 0.5).abs() < 0.02, "{value:?}");
            assert!(value[0] <= last + 0.03 && (-0.01..=1.01).contains(&value[0]), "{x}: {value:?}");
            last = value[0];
        }
    }

    #[test]
    fn nothing_known_gives_the_prior() {
        let mut grid = FaceGrid::new(0, 5);
        grid.fill([1.0, 2.0, 3.0], 1.0);
        assert_eq!(grid.sample(Vec2::splat(0.3)), [1.0, 2.0, 3.0]);
        grid.brighten(|_| [1.0; 3]);
        assert_eq!(grid.sample(Vec2::ONE), [2.0, 3.0, 4.0]);
    }
}
