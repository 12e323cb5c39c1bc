use lo_geometry::Vec3;
use lo_imaging::Image;

use crate::surface::observed_surfaces::bilinear;
use crate::surface::receivers::{Receivers, SAME_SURFACE};

/// Largest difference between factors that are interpolated regardless of surfaces: half a level of an 8-bit image.
const ALIKE: f32 = 0.004;

/// Largest second difference of a smooth factor; interpolation errors are then below a hundredth of the photo's
/// value.
const MAX_BEND: f32 = 0.006;

/// Pixels of a neighbourhood without an edge, see [`Receivers::neighbours`].
const FULL_NEIGHBOURHOOD: usize = 25;

/// Radius in pixels of the search for a point's surface.
const WIDE: usize = 2;

/// Smallest weight of pixels on a surface.
const MIN_ON_SURFACE: f32 = 0.02;

/// Factor of the objects' shadow and bounced light on each pixel of some [`Receivers`].
pub(crate) struct ShadowRatio<'a> {
    receivers: &'a Receivers,
    ratio: Image<Vec3>,
    /// Interpolation between each pixel, the next one, and the two below.
    blends: Image<Blend>,
}

/// Interpolation of the factors of four neighbouring pixels.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Blend {
    /// All factors are 1.
    One,
    /// They are similar: bilinear.
    ByPlace,
    /// Bilinear, weighted by the surface that is seen there.
    BySurface,
}

impl<'a> ShadowRatio<'a> {
    /// Creates the ratio from the factor of each pixel.
    pub fn new(receivers: &'a Receivers, ratio: Image<Vec3>) -> Self {
        let blends = Image::from_fn(ratio.width(), ratio.height(), |x, y| blend(&ratio, x, y));
        Self { receivers, ratio, blends }
    }

    /// Returns where a bilinear lookup is not accurate enough for a finer grid: where the factor bends, or changes
    /// across an edge.
    pub fn rough(&self) -> Image<bool> {
        let (width, height) = (self.ratio.width(), self.ratio.height());
        let rough = Image::from_fn(width, height, |x, y| {
            let (left, right) = (x.saturating_sub(1), (x + 1).min(width - 1));
            let (above, below) = (y.saturating_sub(1), (y + 1).min(height - 1));
            let at = |x: usize, y: usize| self.ratio[(x, y)];
            let bend = [
                at(left, y) + at(right, y) - 2.0 * at(x, y),
                at(x, above) + at(x, below) - 2.0 * at(x, y),
                0.5 * (at(left, above) + at(right, below) - at(right, above) - at(left, below)),
            ];
            let changes = [(left, y), (right, y), (x, above), (x, below)]
                .iter()
                .any(|&(px, py)| (at(px, py) - at(x, y)).abs().max_element() > ALIKE);
            bend.iter().any(|bend| bend.abs().max_element() > MAX_BEND)
                || changes && self.receivers.neighbours(x, y, 1).count() < FULL_NEIGHBOURHOOD.min(width * height)
        });
        // A lookup between pixels also reads the next one.
        Image::from_fn(width, height, |x, y| {
            (y.saturating_sub(1)..(y + 2).min(height))
                .any(|py| (x.saturating_sub(1)..(x + 2).min(width)).any(|px| rough[(px, py)]))
        })
    }

    /// Returns the photo pixels `(left, top, right, bottom)`, the last two exclusive, outside of which the factor is
    /// 1.
    pub fn reach(&self, width: usize, height: usize) -> (usize, usize, usize, usize) {
        let (columns, rows) = (self.ratio.width(), self.ratio.height());
        let (mut left, mut top, mut right, mut bottom) = (columns, rows, 0, 0);
        for y in 0..rows {
            let row = &self.ratio.pixels()[y * columns..(y + 1) * columns];
            let changed = |ratio: &Vec3| *ratio != Vec3::ONE;
            if let (Some(first), Some(last)) = (row.iter().position(changed), row.iter().rposition(changed)) {
                (left, right) = (left.min(first), right.max(last + 1));
                (top, bottom) = (top.min(y), y + 1);
            }
        }
        // A pixel reads the four around it: up to one beyond on each side.
        let low = |at: usize, from: usize, to: usize| at.saturating_sub(1) * to / from;
        let high = |at: usize, from: usize, to: usize| ((at + 1) * to).div_ceil(from).min(to);
        (low(left, columns, width), low(top, rows, height), high(right, columns, width), high(bottom, rows, height))
    }

    /// Returns the factor on the real surface at a world point; 1 if the photo does not show it.
    pub fn at(&self, point: Vec3) -> Vec3 {
        let map = &self.receivers.map;
        let (width, height) = (map.width(), map.height());
        let Some((u, v, _)) = map.camera.project(point) else { return Vec3::ONE };
        if !((0.0..width as f64).contains(&u) && (0.0..height as f64).contains(&v)) {
            return Vec3::ONE;
        }
        let taps = bilinear(u as f32 - 0.5, v as f32 - 0.5, width, height);
        let factor = |x: usize, y: usize| {
            let Some(surface) = self.receivers.surfaces[(x, y)] else { return Vec3::ONE };
            let off_plane_m = surface.normal.dot(point - surface.position_m).abs();
            if off_plane_m > 0.05 * map.depth_m[(x, y)] { Vec3::ONE } else { self.ratio[(x, y)] }
        };
        taps.iter().map(|&(x, y, weight)| factor(x, y) * weight).sum()
    }

    /// Returns the factor for a photo pixel at relative position `(u, v)` with the real surface `seen` there.
    pub fn for_photo(&self, u: f32, v: f32, seen: impl FnOnce() -> Option<Vec3>) -> Vec3 {
        let (width, height) = (self.ratio.width(), self.ratio.height());
        let taps = bilinear(u * width as f32 - 0.5, v * height as f32 - 0.5, width, height);
        match self.blends[(taps[0].0, taps[0].1)] {
            Blend::One => return Vec3::ONE,
            Blend::ByPlace => return taps.iter().map(|&(x, y, weight)| self.ratio[(x, y)] * weight).sum(),
            Blend::BySurface => {}
        }
        let Some(point) = seen() else {
            return taps.iter().map(|&(x, y, weight)| self.ratio[(x, y)] * weight).sum();
        };
        // Near an edge, none of the four may lie on the visible surface, but one further off.
        let (x, y) = (taps[0].0, taps[0].1);
        let near = taps.into_iter();
        let wide = || {
            let columns = x.saturating_sub(WIDE)..(x + WIDE + 2).min(width);
            columns
                .flat_map(move |px| (y.saturating_sub(WIDE)..(y + WIDE + 2).min(height)).map(move |py| (px, py, 1.0)))
        };
        self.on_surface(near, point).or_else(|| self.on_surface(wide(), point)).unwrap_or(Vec3::ONE)
    }

    /// Returns the mean factor of the pixels on a point's surface; `None` if there are hardly any.
    fn on_surface(&self, taps: impl Iterator<Item = (usize, usize, f32)>, point: Vec3) -> Option<Vec3> {
        let mut sum = (Vec3::ZERO, 0.0);
        for (x, y, weight) in taps {
            let Some(surface) = self.receivers.surfaces[(x, y)] else { continue };
            let off_plane_m = surface.normal.dot(point - surface.position_m);
            let tolerance_m = SAME_SURFACE * self.receivers.map.depth_m[(x, y)];
            let closeness = tolerance_m * tolerance_m / (tolerance_m * tolerance_m + off_plane_m * off_plane_m);
            // A small weight for every tap keeps the sum away from zero.
            let weight = (weight + 1e-4) * (closeness * closeness) * (closeness * closeness);
            sum.0 += self.ratio[(x, y)] * weight;
            sum.1 += weight;
        }
        (sum.1 > MIN_ON_SURFACE).then(|| sum.0 / sum.1)
    }
}

fn blend(ratio: &Image<Vec3>, x: usize, y: usize) -> Blend {
    let (right, below) = ((x + 1).min(ratio.width() - 1), (y + 1).min(ratio.height() - 1));
    let factors = [ratio[(x, y)], ratio[(right, y)], ratio[(x, below)], ratio[(right, below)]];
    if factors == [Vec3::ONE; 4] {
        return Blend::One;
    }
    let (low, high) = factors.iter().fold((factors[0], factors[0]), |(low, high), &f| (low.min(f), high.max(f)));
    if (high - low).max_element() < ALIKE { Blend::ByPlace } else { Blend::BySurface }
}
