use std::ops::{Add, Mul};
use std::sync::atomic::{AtomicU32, Ordering};

use lo_geometry::{Plane, Vec3};
use lo_imaging::Image;

use crate::surface::holes;
use crate::surface::observed_surfaces::{Surface, SurfaceMap};

/// Number of interleaved sample patterns (Keller and Heidrich 2001). The pixels of a 4 × 4 block use disjoint
/// patterns. On a plane, a filter over [`Receivers::neighbours`] weights them equally, which leaves neither pattern
/// nor noise.
pub(crate) const PATTERNS: usize = 16;

/// Order of the patterns in a 4 × 4 block: neighbours differ strongly (Bayer 1973).
const BAYER: [usize; PATTERNS] = [0, 8, 2, 10, 12, 4, 14, 6, 3, 11, 1, 9, 15, 7, 13, 5];

/// Largest distance of a surface's points from a pixel's tangent plane, as a share of its depth.
pub(crate) const SAME_SURFACE: f32 = 0.02;

/// Real surfaces that receive light, on their own pixel grid.
pub(crate) struct Receivers {
    pub map: SurfaceMap,
    pub surfaces: Image<Option<Surface>>,
    /// Trust in each surface: 1 at a reading, less where one is extrapolated into a hole.
    pub trust: Image<f32>,
    /// For each pixel, a bit mask of its [`Receivers::neighbours`] in the 5 × 5 around it; 0 if not computed yet.
    masks: Vec<AtomicU32>,
}

/// Returns the sample pattern of the pixel in column `x` and row `y` of an interleaved grid.
pub(crate) fn pattern_at(x: usize, y: usize) -> usize {
    BAYER[(y % 4) * 4 + x % 4]
}

impl Receivers {
    /// Creates receivers, with holes of the map filled; see [`holes`].
    pub fn new(mut map: SurfaceMap, up: Vec3, floor: Option<Plane>) -> Self {
        let trust = holes::fill(&mut map, up, floor);
        let surfaces = Image::from_fn(map.width(), map.height(), |x, y| map.pixel(x, y));
        let masks = surfaces.pixels().iter().map(|_| AtomicU32::new(0)).collect();
        Self { map, surfaces, trust, masks }
    }

    pub fn width(&self) -> usize {
        self.map.width()
    }

    pub fn height(&self) -> usize {
        self.map.height()
    }

    /// Returns the pixels on the same surface among the 5 × 5 around `(x, y)` on the grid of every `stride`-th pixel,
    /// with weights. The outer ones count half, so that all patterns have equal weight; the sum is 1.
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
            Some((px, py, weight_at(dx, dy)))
        })
    }

    /// Returns the weighted sum of an image over the [`Receivers::neighbours`] of a pixel, and the sum of their
    /// weights. The neighbours are cached for the next frame.
    pub fn filtered<T>(&self, image: &Image<T>, x: usize, y: usize) -> (T, f32)
    where
        T: Copy + Default + Add<Output = T> + Mul<f32, Output = T>,
    {
        let width = self.width();
        let mask = &self.masks[y * width + x];
        let mut places = mask.load(Ordering::Relaxed);
        if places == 0 {
            for (px, py, _) in self.neighbours(x, y, 1) {
                places |= 1 << ((py + 2 - y) * 5 + px + 2 - x);
            }
            // Other threads store the same value.
            mask.store(places, Ordering::Relaxed);
        }
        let (mut sum, mut total) = (T::default(), 0.0);
        while places != 0 {
            let place = places.trailing_zeros() as usize;
            places &= places - 1;
            let weight = weight_at(place as isize % 5 - 2, place as isize / 5 - 2);
            sum = sum + image.pixels()[(y + place / 5 - 2) * width + x + place % 5 - 2] * weight;
            total += weight;
        }
        (sum, total)
    }
}

/// Returns the weight of the neighbour at an offset of up to two pixels.
fn weight_at(dx: isize, dy: isize) -> f32 {
    let along = |offset: isize| if offset.abs() == 2 { 0.25 } else { 0.5 };
    0.25 * along(dx) * along(dy)
}
