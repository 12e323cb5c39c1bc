use imaging::Image;

use crate::surface::{Surface, SurfaceMap};

/// Patterns of the interleaving (Keller and Heidrich 2001): the pixels of a 4 × 4 block use as many disjoint sample patterns, and a
/// filter over [`Receivers::neighbours`] takes each in equal parts on a plane, which leaves no pattern and no noise.
pub(crate) const PATTERNS: usize = 16;

/// Order in which a 4 × 4 block uses the patterns: neighbours differ much (Bayer 1973).
const BAYER: [usize; PATTERNS] = [0, 8, 2, 10, 12, 4, 14, 6, 3, 11, 1, 9, 15, 7, 13, 5];

/// Points further from a pixel's tangent plane than this share of its depth belong to another surface.
pub(crate) const SAME_SURFACE: f32 = 0.02;

/// Real surfaces that light falls on, on a pixel grid of their own.
pub(crate) struct Receivers {
    pub map: SurfaceMap,
    pub surfaces: Image<Option<Surface>>,
}

/// The sample pattern of the pixel in column `x` and row `y` of an interleaved grid.
pub(crate) fn pattern_at(x: usize, y: usize) -> usize {
    BAYER[(y % 4) * 4 + x % 4]
}

impl Receivers {
    pub fn new(map: SurfaceMap) -> Self {
        let surfaces = Image::from_fn(map.width(), map.height(), |x, y| map.pixel(x, y));
        Self { map, surfaces }
    }

    pub fn width(&self) -> usize {
        self.map.width()
    }

    pub fn height(&self) -> usize {
        self.map.height()
    }

    /// The pixels on the same surface among the 5 × 5 around `(x, y)` on the grid of every `stride`-th pixel, with weights: the
    /// outer ones count half, so each pattern weighs the same, 1 in sum.
    pub fn neighbours(&self, x: usize, y: usize, stride: usize) -> impl Iterator<Item = (usize, usize, f32)> {
        let centre = self.surfaces[(x, y)];
        let tolerance_m = SAME_SURFACE * self.map.depth_m[(x, y)];
        let on_grid = move |at: usize, step: isize, limit: usize| {
            (at / stride).checked_add_signed(step).map(|cell| cell * stride).filter(|&at| at < limit)
        };
        (-2isize..=2).flat_map(|dy| (-2isize..=2).map(move |dx| (dx, dy))).filter_map(move |(dx, dy)| {
            let (px, py) = (on_grid(x, dx, self.width())?, on_grid(y, dy, self.height())?);
            let (centre, other) = (centre?, self.surfaces[(px, py)]?);
            let off_plane_m = centre.normal.dot(other.position_m - centre.position_m).abs();
            if off_plane_m > tolerance_m || centre.normal.dot(other.normal) < 0.8 {
                return None;
            }
            let weight = if dx.abs() == 2 { 0.25 } else { 0.5 } * if dy.abs() == 2 { 0.25 } else { 0.5 };
            Some((px, py, 0.25 * weight))
        })
    }
}
