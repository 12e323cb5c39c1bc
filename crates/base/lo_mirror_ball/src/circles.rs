//! Detection of circles that may be the outline of a mirror ball, in a downsampled photo.

use rayon::prelude::*;

use super::BallCircle;
use super::view::turns;
use lo_imaging::{Image, resize};

/// Longer side of the image in which circles are detected, in pixels.
pub(super) const DETECTION_SIDE: usize = 480;
/// Range of radii, as shares of that image's shorter and longer side.
const RADII: [f64; 2] = [0.07, 0.55];
/// Share of the pixels, those with the strongest gradients, that are edge candidates.
const EDGE_SHARE: f64 = 0.12;
/// Number of sectors of a circle; those with an edge are counted.
const SECTORS: usize = 32;
/// Least cosine between gradient and radius for an edge that belongs to a circle.
const MIN_ALIGNMENT: f32 = 0.94;
/// Number of peaks of the Hough transform that are examined.
const MAX_PEAKS: usize = 200;
/// Number of circles around them that are refined.
const MAX_CANDIDATES: usize = 80;
/// Inner end of the ball's rim and outer end of its surroundings, over the radius.
const RIM: [f64; 2] = [0.6, 1.25];

/// Detects circles by the Hough transform and scores them by how a mirror compresses the room towards its rim.
pub(super) struct CircleDetector {
    gradients: Image<[f32; 2]>,
    edges: Vec<EdgePixel>,
    /// Squared gradient below which a pixel has no reliable direction.
    faint: f32,
    /// Pixels of the photo per pixel of the detection image, horizontally and vertically.
    scale: [f64; 2],
}

impl CircleDetector {
    pub fn new(grey: &Image<f32>) -> Self {
        let factor = (grey.width().max(grey.height()) as f64 / DETECTION_SIDE as f64).max(1.0);
        let small_side = |side: usize| ((side as f64 / factor).round() as usize).max(1);
        let as_colour = grey.map(|&v| [v; 3]);
        let small = resize(&as_colour, small_side(grey.width()), small_side(grey.height())).map(|rgb| rgb[0]);
        let scale = [grey.width() as f64 / small.width() as f64, grey.height() as f64 / small.height() as f64];
        let gradients = gradients(&smoothed(&small));
        let mut squares: Vec<f32> = gradients.pixels().iter().map(|[x, y]| x * x + y * y).collect();
        let middle = squares.len() / 2;
        let faint = (0.1 * *squares.select_nth_unstable_by(middle, f32::total_cmp).1).max(1e-9);
        Self { edges: edges(&gradients), gradients, faint, scale }
    }

    /// Converts a circle of the detection image to photo pixels.
    pub fn photo_circle(&self, circle: BallCircle) -> BallCircle {
        let [sx, sy] = self.scale;
        BallCircle { x: circle.x * sx, y: circle.y * sy, radius_px: circle.radius_px * (sx * sy).sqrt() }
    }

    /// Converts a circle of the photo to pixels of the detection image.
    pub fn detection_circle(&self, circle: BallCircle) -> BallCircle {
        let [sx, sy] = self.scale;
        BallCircle { x: circle.x / sx, y: circle.y / sy, radius_px: circle.radius_px / (sx * sy).sqrt() }
    }

    /// Returns circles proposed by edges, most mirror-like first.
    pub fn candidates(&self) -> Vec<BallCircle> {
        let [width, height] = [self.gradients.width(), self.gradients.height()];
        let shorter = width.min(height) as f64;
        let radii = [(RADII[0] * shorter).max(5.0), RADII[1] * width.max(height) as f64];
        if self.edges.len() < 20 || radii[0] >= radii[1] {
            return Vec::new();
        }
        let mut circles: Vec<(f64, BallCircle)> = peaks(&self.edges, [width, height], radii)
            .into_par_iter()
            .flat_map_iter(|at| best_radii(&self.edges, at, [width, height], radii))
            .collect();
        circles.par_iter_mut().for_each(|(score, circle)| *score = self.significance(*circle).unwrap_or(-1.0));
        circles.sort_by(|a, b| b.0.total_cmp(&a.0));
        distinct(circles, MAX_CANDIDATES)
    }

    /// Refines a circle by hill climbing in steps of up to 3 pixels. Returns the significance and the circle.
    pub fn refine(&self, circle: BallCircle) -> Option<(f64, BallCircle)> {
        let mut best = (self.significance(circle)?, circle);
        for step in [3.0, 1.5, 0.75, 0.375] {
            for _ in 0..12 {
                let BallCircle { x, y, radius_px } = best.1;
                let around = [
                    BallCircle { x: x + step, ..best.1 },
                    BallCircle { x: x - step, ..best.1 },
                    BallCircle { y: y + step, ..best.1 },
                    BallCircle { y: y - step, ..best.1 },
                    BallCircle { radius_px: radius_px + step, ..best.1 },
                    BallCircle { radius_px: radius_px - step, ..best.1 },
                ];
                let tried = around.into_iter().filter_map(|circle| Some((self.significance(circle)?, circle)));
                match tried.max_by(|a, b| a.0.total_cmp(&b.0)).filter(|next| next.0 > best.0) {
                    Some(next) => best = next,
                    None => break,
                }
            }
        }
        Some(best)
    }

    /// Contrast times the root of the radius: a larger ball's contrast is a mean over more pixels.
    fn significance(&self, circle: BallCircle) -> Option<f64> {
        Some(mean(&self.sectors(circle)?) * circle.radius_px.sqrt())
    }

    /// Mean excess, over all sectors, of the radial alignment of gradients inside the rim over that outside.
    pub fn contrast(&self, circle: BallCircle) -> Option<f64> {
        Some(mean(&self.sectors(circle)?))
    }

    /// Returns the excess of radial alignment in each sector that is inside the image.
    ///
    /// The alignment of a gradient is (radial² − tangential²) ÷ (radial² + tangential²). Inside the rim it is fitted by
    /// that of a mirror in a room with gradients in all directions. Its mean outside, if positive, is subtracted.
    fn sectors(&self, circle: BallCircle) -> Option<Vec<f64>> {
        let r = circle.radius_px;
        if r < 4.0 {
            return None;
        }
        let inner = [RIM[0] * r, r - 0.5];
        let outer = [r + 1.5, (RIM[1] * r).max(r + 4.0)];
        let lines = ((std::f64::consts::TAU * r / SECTORS as f64) as usize).clamp(2, 8);
        let known: Vec<f64> = (0..SECTORS)
            .filter_map(|sector| {
                let turns = || {
                    (0..lines).map(move |line| (sector as f64 + (line as f64 + 0.5) / lines as f64) / SECTORS as f64)
                };
                let mirror_alignment = |at: f64| {
                    let ratio = (1.0 - (at / r) * (at / r)).max(0.0).powi(2);
                    (1.0 - ratio) / (1.0 + ratio)
                };
                let inside = self.alignment(circle, inner, turns(), mirror_alignment)?;
                // surroundings outside the image count as unaligned
                let outside = self.alignment(circle, outer, turns(), |_| 1.0).unwrap_or(0.0);
                Some(inside - outside.max(0.0))
            })
            .collect();
        (known.len() as f64 >= MIN_INSIDE * SECTORS as f64).then_some(known)
    }

    /// Returns the least-squares factor of `expected`, a function of the radius, on the gradients' radial alignment;
    /// `None` if a part is outside the image.
    fn alignment(
        &self,
        circle: BallCircle,
        [from, to]: [f64; 2],
        turns: impl Iterator<Item = f64>,
        expected: impl Fn(f64) -> f64,
    ) -> Option<f64> {
        let rings = ((to - from).ceil() as usize).max(1);
        let [mut sum, mut weights] = [0.0f64; 2];
        for turn in turns {
            let (sin, cos) = (turn * std::f64::consts::TAU).sin_cos();
            for ring in 0..rings {
                let at = from + (to - from) * (ring as f64 + 0.5) / rings as f64;
                let (x, y) = (circle.x + at * cos, circle.y + at * sin);
                let (column, row) = (x.floor(), y.floor());
                let inner = |v: f64, count: usize| v >= 1.0 && v < count as f64 - 1.0;
                if !inner(column, self.gradients.width()) || !inner(row, self.gradients.height()) {
                    return None;
                }
                let [gx, gy] = self.gradients[(column as usize, row as usize)];
                let radial = gx * cos as f32 + gy * sin as f32;
                let tangential = gy * cos as f32 - gx * sin as f32;
                let (radial, tangential) = (radial * radial, tangential * tangential);
                let weight = expected(at);
                sum += weight * f64::from((radial - tangential) / (radial + tangential + self.faint));
                weights += weight * weight;
            }
        }
        Some(sum / weights)
    }
}

/// Returns the first `most` circles that differ by more than 3 pixels.
pub(super) fn distinct(circles: Vec<(f64, BallCircle)>, most: usize) -> Vec<BallCircle> {
    let mut kept: Vec<BallCircle> = Vec::new();
    for (_, circle) in circles {
        let near = |other: &BallCircle| {
            (other.x - circle.x).hypot(other.y - circle.y) < 3.0 && (other.radius_px - circle.radius_px).abs() < 3.0
        };
        if !kept.iter().any(near) {
            kept.push(circle);
        }
        if kept.len() == most {
            break;
        }
    }
    kept
}

fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}

/// Least share of the outline that must be inside the photo.
const MIN_INSIDE: f64 = 0.6;

/// An edge pixel of the detection image.
struct EdgePixel {
    x: f32,
    y: f32,
    /// Unit gradient.
    gradient: [f32; 2],
}

/// Smooths by a binomial filter, 5 × 5.
fn smoothed(image: &Image<f32>) -> Image<f32> {
    let [width, height] = [image.width(), image.height()];
    let taps = [1.0 / 16.0, 4.0 / 16.0, 6.0 / 16.0, 4.0 / 16.0, 1.0 / 16.0];
    let at = |position: usize, offset: usize, count: usize| (position + offset).saturating_sub(2).min(count - 1);
    let across =
        Image::from_fn(width, height, |x, y| (0..5).map(|i| taps[i] * image[(at(x, i, width), y)]).sum::<f32>());
    Image::from_fn(width, height, |x, y| (0..5).map(|i| taps[i] * across[(x, at(y, i, height))]).sum::<f32>())
}

/// Central differences; 0 at the border.
fn gradients(image: &Image<f32>) -> Image<[f32; 2]> {
    let [width, height] = [image.width(), image.height()];
    Image::from_fn(width, height, |x, y| {
        if x == 0 || y == 0 || x + 1 == width || y + 1 == height {
            return [0.0; 2];
        }
        [image[(x + 1, y)] - image[(x - 1, y)], image[(x, y + 1)] - image[(x, y - 1)]]
    })
}

/// Returns the strongest gradients, after non-maximum suppression across the edge.
fn edges(gradients: &Image<[f32; 2]>) -> Vec<EdgePixel> {
    let [width, height] = [gradients.width(), gradients.height()];
    if width < 3 || height < 3 {
        return Vec::new();
    }
    let strength = gradients.map(|[gx, gy]| gx.hypot(*gy));
    let mut sorted = strength.pixels().to_vec();
    let weakest = ((1.0 - EDGE_SHARE) * (sorted.len() - 1) as f64) as usize;
    let least = *sorted.select_nth_unstable_by(weakest, f32::total_cmp).1;
    let mut edges = Vec::new();
    for (x, y) in (1..height - 1).flat_map(|y| (1..width - 1).map(move |x| (x, y))) {
        let s = strength[(x, y)];
        if s <= least.max(1e-6) {
            continue;
        }
        let [gx, gy] = gradients[(x, y)].map(|g| g / s);
        let (dx, dy) = (gx.round() as isize, gy.round() as isize);
        let neighbour = |sign: isize| strength[(x.wrapping_add_signed(sign * dx), y.wrapping_add_signed(sign * dy))];
        if s >= neighbour(1) && s >= neighbour(-1) {
            edges.push(EdgePixel { x: x as f32 + 0.5, y: y as f32 + 0.5, gradient: [gx, gy] });
        }
    }
    edges
}

/// Returns the centres with most votes: positions where lines along gradients meet.
fn peaks(edges: &[EdgePixel], [width, height]: [usize; 2], radii: [f64; 2]) -> Vec<[f32; 2]> {
    let mut votes = Image::new(width, height, vec![0.0f32; width * height]);
    for edge in edges {
        for sign in [-1.0, 1.0] {
            for step in radii[0] as usize..=radii[1] as usize {
                let along = sign * step as f32;
                let (x, y) = ((edge.x + along * edge.gradient[0]).floor(), (edge.y + along * edge.gradient[1]).floor());
                if x >= 0.0 && y >= 0.0 && (x as usize) < width && (y as usize) < height {
                    votes[(x as usize, y as usize)] += 1.0;
                }
            }
        }
    }
    let votes = smoothed(&votes);
    let mut found: Vec<(f32, [f32; 2])> = Vec::new();
    for (x, y) in (0..height).flat_map(|y| (0..width).map(move |x| (x, y))) {
        let vote = votes[(x, y)];
        let around = (y.saturating_sub(1)..(y + 2).min(height))
            .flat_map(|v| (x.saturating_sub(1)..(x + 2).min(width)).map(move |u| (u, v)));
        if vote > 0.0 && around.into_iter().all(|at| votes[at] <= vote) {
            found.push((vote, [x as f32 + 0.5, y as f32 + 0.5]));
        }
    }
    found.sort_by(|a, b| b.0.total_cmp(&a.0));
    found.into_iter().take(MAX_PEAKS).map(|(_, at)| at).collect()
}

/// Returns the two radii around a centre whose circles have edges in most sectors, corrected for chance.
fn best_radii(
    edges: &[EdgePixel],
    [x, y]: [f32; 2],
    [width, height]: [usize; 2],
    radii: [f64; 2],
) -> Vec<(f64, BallCircle)> {
    let count = radii[1] as usize + 3;
    let mut sectors = vec![0u64; count];
    let mut lengths = vec![0.0f64; count];
    for edge in edges {
        let (dx, dy) = (edge.x - x, edge.y - y);
        let distance = dx.hypot(dy);
        if (distance as usize) + 1 >= count || distance < 2.0 {
            continue;
        }
        let along = (dx * edge.gradient[0] + dy * edge.gradient[1]) / distance;
        if along.abs() >= MIN_ALIGNMENT {
            let turn = dy.atan2(dx) / std::f32::consts::TAU + 0.5;
            let sector = ((turn * SECTORS as f32) as usize).min(SECTORS - 1);
            sectors[distance as usize] |= 1u64 << sector;
            lengths[distance as usize] += 1.0;
        }
    }
    // aligned edges per pixel around this centre
    let density = lengths.iter().sum::<f64>() / (std::f64::consts::PI * (count * count) as f64);
    let score = |r: usize| {
        let covered = f64::from((sectors[r - 1] | sectors[r] | sectors[r + 1]).count_ones()) / SECTORS as f64;
        let sector_area = 3.0 * std::f64::consts::TAU * r as f64 / SECTORS as f64;
        let chance = 1.0 - (-density * sector_area).exp();
        (covered - chance) / (1.0 - chance).max(0.05)
    };
    let mut scored: Vec<(f64, usize)> =
        (radii[0].ceil() as usize..=(radii[1] as usize).min(count - 2)).map(|r| (score(r), r)).collect();
    scored.sort_by(|a, b| b.0.total_cmp(&a.0));
    let inside = |r: f64| {
        let outline = turns(SECTORS).filter(|turn| {
            let (u, v) = (f64::from(x) + r * turn.cos(), f64::from(y) + r * turn.sin());
            u >= 0.0 && v >= 0.0 && u <= width as f64 && v <= height as f64
        });
        outline.count() as f64 / SECTORS as f64
    };
    scored
        .into_iter()
        .take(2)
        .map(|(score, r)| {
            let radius_px = r as f64 + 0.5;
            (score, BallCircle { x: x.into(), y: y.into(), radius_px })
        })
        .filter(|(_, circle)| inside(circle.radius_px) >= MIN_INSIDE)
        .collect()
}
