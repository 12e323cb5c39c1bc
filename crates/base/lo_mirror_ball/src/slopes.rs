//! Slopes of grey values along the radius, on both sides of a ball's outline.

use super::BallView;
use super::view::turns;
use lo_imaging::Image;

/// Number of lines across the outline.
const LINES: usize = 720;
/// Number of lines in a sector of the fit.
const LINES_A_SECTOR: usize = 20;
/// Distance between positions on a line, in pixels.
const STEP_PX: f64 = 0.5;
/// Width, in pixels, of the strips on both sides of the outline that the fit compares.
const STRIP_PX: f64 = 3.0;
/// Distance of the strips' greatest contrast outside the outline, in pixels: a slope extends a pixel to each side.
const STRIP_BIAS_PX: f64 = 1.25;

/// Slopes along lines across an outline.
pub(super) struct Slopes<'a> {
    view: &'a BallView,
    /// Slopes by line and position on it, from inside to outside; `None` for a line that leaves the image.
    lines: Vec<Option<Vec<f64>>>,
    /// Median slope.
    typical: f64,
    /// Number of positions on a line.
    positions: usize,
}

impl<'a> Slopes<'a> {
    /// Measures slopes up to `band_px` on both sides of the outline; `None` if all lines leave the image.
    ///
    /// Averages neighbouring lines. Along the outline the ball's reflection changes little over some degrees, whereas
    /// the background averages out.
    pub fn across(grey: &Image<f32>, view: &'a BallView, band_px: f64) -> Option<Self> {
        let middle = [view.circle().x, view.circle().y];
        let reach = (1.0 / STEP_PX).round() as usize;
        let half = (band_px / STEP_PX).ceil() as usize + reach;
        let count = 2 * half + 1;
        let inside =
            |p: [f64; 2]| p[0] >= 0.0 && p[1] >= 0.0 && p[0] <= grey.width() as f64 && p[1] <= grey.height() as f64;
        let values: Vec<Option<Vec<f32>>> = turns(LINES)
            .map(|turn| {
                let at = view.outline(turn)?;
                let radius = distance(at, middle);
                let place = |index: usize| {
                    let share = (index as f64 - half as f64) * STEP_PX / radius;
                    [0, 1].map(|i| at[i] + share * (at[i] - middle[i]))
                };
                let known = radius > half as f64 * STEP_PX && inside(place(0)) && inside(place(count - 1));
                known.then(|| (0..count).map(|index| bilinear(grey, place(index))).collect())
            })
            .collect();
        let line = |index: isize| values[index.rem_euclid(LINES as isize) as usize].as_ref();
        let lines: Vec<Option<Vec<f64>>> = (0..LINES as isize)
            .map(|index| {
                line(index)?;
                let near: Vec<&Vec<f32>> = (index - 3..=index + 3).filter_map(line).collect();
                let mean =
                    |place: usize| near.iter().map(|line| f64::from(line[place])).sum::<f64>() / near.len() as f64;
                let means: Vec<f64> = (0..count).map(mean).collect();
                Some((reach..count - reach).map(|i| (means[i + reach] - means[i - reach]).abs()).collect())
            })
            .collect();
        let mut all: Vec<f64> = lines.iter().flatten().flatten().copied().collect();
        let middle_slope = all.len() / 2;
        let typical =
            if all.is_empty() { return None } else { *all.select_nth_unstable_by(middle_slope, f64::total_cmp).1 };
        Some(Self { view, lines, typical: typical.max(1e-6), positions: count - 2 * reach })
    }

    /// Distance of a position from the outline in pixels; positive outside.
    fn offset_px(&self, place: f64) -> f64 {
        (place - 0.5 * (self.positions - 1) as f64) * STEP_PX
    }

    /// Share of lines with a slope maximum on the outline, within a pixel or 0.3 % of its radius.
    pub fn edges_on_outline(&self) -> f64 {
        let near_px = 1.0f64.max(0.003 * self.view.circle().radius_px);
        let on = |line: &&Vec<f64>| {
            let least = (0.3 * line.iter().copied().fold(0.0, f64::max)).max(1.5 * self.typical);
            (1..self.positions - 1).any(|i| {
                let is_peak = line[i] >= least && line[i] >= line[i - 1] && line[i] > line[i + 1];
                // an edge at the outline is steepest half a pixel inside it, see `STRIP_BIAS_PX`
                is_peak && (self.offset_px(i as f64) + 0.5).abs() <= near_px
            })
        };
        let known: Vec<&Vec<f64>> = self.lines.iter().flatten().collect();
        known.iter().copied().filter(|line| on(line)).count() as f64 / known.len().max(1) as f64
    }

    /// Returns, for each sector, the point with the greatest contrast between the slopes inside and outside it.
    pub fn outline_points(&self) -> Vec<OutlinePoint> {
        let strip = (STRIP_PX / STEP_PX).round() as usize;
        let middle = [self.view.circle().x, self.view.circle().y];
        let sector = |sector: usize| {
            let first = sector * LINES_A_SECTOR;
            let known: Vec<&Vec<f64>> = self.lines[first..first + LINES_A_SECTOR].iter().flatten().collect();
            if known.len() < LINES_A_SECTOR / 2 || self.positions < 2 * strip + 3 {
                return None;
            }
            let steep = |place: usize| {
                known.iter().map(|line| line[place] / (line[place] + self.typical)).sum::<f64>() / known.len() as f64
            };
            let profile: Vec<f64> = (0..self.positions).map(steep).collect();
            let mean = |range: std::ops::Range<usize>| profile[range].iter().sum::<f64>() / strip as f64;
            let contrast = |i: usize| mean(i - strip..i) - mean(i..i + strip);
            let last = self.positions - strip;
            let best = (strip..=last).max_by(|&a, &b| contrast(a).total_cmp(&contrast(b)))?;
            let here = contrast(best);
            if here <= 0.05 || best == strip || best == last {
                return None;
            }
            let (before, after) = (contrast(best - 1), contrast(best + 1));
            let curve = before - 2.0 * here + after;
            let peak = if curve < 0.0 { 0.5 * (before - after) / curve } else { 0.0 };
            // the inner strip ends half a step before the outer one's first position
            let offset = self.offset_px(best as f64 + peak - 0.5) - STRIP_BIAS_PX;
            let turn = (first as f64 + 0.5 * (LINES_A_SECTOR - 1) as f64) / LINES as f64 * std::f64::consts::TAU;
            let at = self.view.outline(turn)?;
            let share = offset / distance(at, middle);
            Some(OutlinePoint { turn, point: [0, 1].map(|i| at[i] + share * (at[i] - middle[i])), contrast: here })
        };
        (0..LINES / LINES_A_SECTOR).filter_map(sector).collect()
    }
}

/// A measured point of the outline.
pub(super) struct OutlinePoint {
    /// Angle around the outline in radians.
    pub turn: f64,
    /// Image position in pixels.
    pub point: [f64; 2],
    /// Contrast of slopes inside and outside the point.
    pub contrast: f64,
}

pub(super) fn distance(a: [f64; 2], b: [f64; 2]) -> f64 {
    (a[0] - b[0]).hypot(a[1] - b[1])
}

fn bilinear(image: &Image<f32>, [x, y]: [f64; 2]) -> f32 {
    let axis = |position: f64, count: usize| {
        let position = (position - 0.5).clamp(0.0, (count - 1) as f64);
        let first = position as usize;
        (first, (first + 1).min(count - 1), (position - first as f64) as f32)
    };
    let (x0, x1, fx) = axis(x, image.width());
    let (y0, y1, fy) = axis(y, image.height());
    let mix = |a: f32, b: f32, t: f32| a + (b - a) * t;
    mix(mix(image[(x0, y0)], image[(x1, y0)], fx), mix(image[(x0, y1)], image[(x1, y1)], fx), fy)
}
