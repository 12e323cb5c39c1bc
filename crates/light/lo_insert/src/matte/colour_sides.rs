//! Classification of colours between two sides, from the colours of both sides near by.

use lo_geometry::{Mat3, Vec3};

/// Noise of a photo's colours in sRGB's range; smaller differences are ignored.
const NOISE: f32 = 0.02;

/// Cells on each side of a cell that it learns from.
const REACH: isize = 2;

/// Weight of a side's colours, in pixels, at which they are fully trusted.
const MIN_WEIGHT: f32 = 4.0;

/// Sums over the pixels of one side in a cell: weight, colours, products of colours.
#[derive(Clone, Copy, Default)]
struct Moments {
    weight: f32,
    colour: Vec3,
    /// Products xx, yy, zz and xy, xz, yz.
    squares: Vec3,
    products: Vec3,
}

impl Moments {
    fn add(&mut self, colour: Vec3, weight: f32) {
        self.weight += weight;
        self.colour += colour * weight;
        self.squares += colour * colour * weight;
        self.products += Vec3::new(colour.x * colour.y, colour.x * colour.z, colour.y * colour.z) * weight;
    }

    fn add_all(&mut self, other: &Self, factor: f32) {
        self.weight += factor * other.weight;
        self.colour += factor * other.colour;
        self.squares += factor * other.squares;
        self.products += factor * other.products;
    }

    fn mean(&self) -> Vec3 {
        self.colour / self.weight
    }

    /// Returns the covariance: variances and covariances of the channels.
    fn covariance(&self) -> (Vec3, Vec3) {
        let mean = self.mean();
        let squares = (self.squares / self.weight - mean * mean).max(Vec3::ZERO);
        (squares, self.products / self.weight - Vec3::new(mean.x * mean.y, mean.x * mean.z, mean.y * mean.z))
    }
}

/// A cell's linear discriminant (Fisher 1936).
#[derive(Clone, Copy, Default)]
struct Discriminant {
    direction: Vec3,
    offset: f32,
}

/// Colours of two sides, learned in cells of a grid.
pub(crate) struct ColourSides {
    columns: usize,
    rows: usize,
    cell: usize,
    discriminants: Vec<Discriminant>,
}

impl ColourSides {
    /// Learns from `pixels`: column, row, colour in sRGB's range, weight on the first and on the second side. `cell`
    /// is the grid's pitch in pixels.
    pub fn new(
        (width, height): (usize, usize),
        cell: usize,
        pixels: impl Iterator<Item = (usize, usize, Vec3, [f32; 2])>,
    ) -> Self {
        let (columns, rows) = (width.div_ceil(cell), height.div_ceil(cell));
        let mut cells = vec![[Moments::default(); 2]; columns * rows];
        for (x, y, colour, weights) in pixels {
            let cell = &mut cells[y / cell * columns + x / cell];
            for (moments, weight) in cell.iter_mut().zip(weights).filter(|(_, weight)| *weight > 0.0) {
                moments.add(colour, weight);
            }
        }
        let discriminants = (0..columns * rows).map(|i| discriminant(&cells, columns, rows, i)).collect();
        Self { columns, rows, cell, discriminants }
    }

    /// Returns the log likelihood ratio of the first side for a colour at a pixel; 0 if unknown.
    pub fn log_ratio(&self, x: usize, y: usize, colour: Vec3) -> f32 {
        let at = |position: usize| (position as f32 + 0.5) / self.cell as f32 - 0.5;
        let taps = crate::surface::observed_surfaces::bilinear(at(x), at(y), self.columns, self.rows);
        taps.iter()
            .map(|&(x, y, weight)| {
                let Discriminant { direction, offset } = self.discriminants[y * self.columns + x];
                weight * (direction.dot(colour) - offset)
            })
            .sum()
    }
}

fn discriminant(cells: &[[Moments; 2]], columns: usize, rows: usize, i: usize) -> Discriminant {
    let mut sides = [Moments::default(); 2];
    for dy in -REACH..=REACH {
        for dx in -REACH..=REACH {
            let (Some(x), Some(y)) = ((i % columns).checked_add_signed(dx), (i / columns).checked_add_signed(dy))
            else {
                continue;
            };
            if x >= columns || y >= rows {
                continue;
            }
            let factor = |step: isize| 1.0 - step.unsigned_abs() as f32 / (REACH + 1) as f32;
            for (sum, moments) in sides.iter_mut().zip(&cells[y * columns + x]) {
                sum.add_all(moments, factor(dx) * factor(dy));
            }
        }
    }
    if sides.iter().any(|side| side.weight < MIN_WEIGHT) {
        return Discriminant::default();
    }
    let [(squares, products), (other_squares, other_products)] = sides.map(|side| side.covariance());
    let (squares, products) = (0.5 * (squares + other_squares) + NOISE * NOISE, 0.5 * (products + other_products));
    let scatter = Mat3::from_cols(
        Vec3::new(squares.x, products.x, products.y),
        Vec3::new(products.x, squares.y, products.z),
        Vec3::new(products.y, products.z, squares.z),
    );
    let [first, second] = sides.map(|side| side.mean());
    let direction = scatter.inverse() * (first - second);
    if !direction.is_finite() {
        return Discriminant::default();
    }
    Discriminant { direction, offset: 0.5 * direction.dot(first + second) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn noisy_colours_are_told_apart_where_both_sides_are_known() {
        // The first side is red on the left and green on the right, in front of grey; beyond 80 pixels there is no
        // first side.
        let mut state = 3u32;
        let mut noise = || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            ((state >> 8) as f32 / (1 << 24) as f32 - 0.5) * 0.1
        };
        let colour = |x: usize| if x < 40 { Vec3::new(0.6, 0.2, 0.2) } else { Vec3::new(0.2, 0.6, 0.2) };
        let grey = Vec3::splat(0.4);
        let mut pixels = Vec::new();
        for y in 0..40 {
            for x in 0..160 {
                let first = y < 20 && x < 80;
                let seen = (if first { colour(x) } else { grey }) + Vec3::new(noise(), noise(), noise());
                pixels.push((x, y, seen, if first { [1.0, 0.0] } else { [0.0, 0.5] }));
            }
        }
        let sides = ColourSides::new((160, 40), 8, pixels.into_iter());
        for (x, y) in [(5, 19), (20, 22), (60, 20), (70, 15)] {
            assert!(sides.log_ratio(x, y, colour(x)) > 5.0 && sides.log_ratio(x, y, grey) < -5.0, "{x} {y}");
            let between = sides.log_ratio(x, y, 0.5 * (colour(x) + grey));
            assert!(between.abs() < 3.0, "half of each is neither: {between}");
        }
        assert_eq!(sides.log_ratio(140, 20, colour(10)), 0.0, "nothing is known of the first side here");
    }
}
