//! The ball's outline: Hough's transform along gradients on a small picture, then a robust fit to edges across the outline.

use rayon::prelude::*;

use super::view::turns;
use super::{BallCircle, BallError, BallLens, BallView};
use crate::{Image, RadianceImage, luminance, resize};

/// The best outline that was found.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BallFind {
    /// The ball with this outline.
    pub view: BallView,
    /// Share of the outline's directions in which an edge lies on it, within [`ON_OUTLINE_PX`] or 0.4 % of its radius.
    pub confidence: f64,
}

impl BallFind {
    /// From this confidence on the find is a ball. Chosen on circles found in photos without one, the best of which reach TODO.
    pub const SURE: f64 = 0.5;
}

/// An edge that near lies on the outline.
const ON_OUTLINE_PX: f64 = 1.5;
/// Longer side of the picture in which circles are looked for.
const SMALL_SIDE: usize = 320;
/// Radii that are looked for, over the small picture's shorter and longer side.
const RADII: [f64; 2] = [0.05, 0.55];
/// Strongest share of the small picture's pixels that count as edges.
const EDGE_SHARE: f64 = 0.12;
/// Sectors of a circle, of which those with an edge are counted.
const SECTORS: usize = 64;
/// An edge belongs to a circle where its gradient points along the radius to within this angle's cosine.
const ALIGNED: f32 = 0.94;
/// Peaks of the transform that are looked at, and those of them that are fitted.
const PEAKS: usize = 200;
const FITTED: usize = 12;
/// Directions in which edges are looked for across an outline.
const DIRECTIONS: usize = 360;

/// Finds the ball in a photo of it, with a lens as for [`BallView::new`]; `None` where no circle at all is found, and for an unsure one see
/// [`BallFind::SURE`].
///
/// # Errors
/// A photo without pixels, a lens that is none.
pub fn find_ball(photo: &RadianceImage, lens: BallLens) -> Result<Option<BallFind>, BallError> {
    let size = [photo.width(), photo.height()];
    if size[0] * size[1] == 0 {
        return Err(BallError::NoPhoto);
    }
    check_lens(lens)?;
    let grey = grey(photo);
    let candidates = candidates(&grey);
    let finds: Vec<BallFind> =
        candidates.into_par_iter().filter_map(|circle| refined(&grey, circle, lens, size)).collect();
    Ok(finds.into_iter().max_by(|a, b| a.confidence.total_cmp(&b.confidence)))
}

fn check_lens(lens: BallLens) -> Result<(), BallError> {
    let valid = match lens {
        BallLens::Orthographic => true,
        BallLens::Focal { focal_px } => focal_px.is_finite() && focal_px > 0.0,
        BallLens::Distance { radii } => radii.is_finite() && radii > 1.0,
    };
    if valid { Ok(()) } else { Err(BallError::Lens { lens }) }
}

/// Logarithm of luminance over the median one: lamps do not hide all other edges, and noise in the dark counts little.
fn grey(photo: &RadianceImage) -> Image<f32> {
    let mut values: Vec<f32> = photo.pixels().par_iter().map(|&rgb| luminance(rgb).max(0.0)).collect();
    let step = (values.len() / 100_000).max(1);
    let mut some: Vec<f32> = values.iter().copied().step_by(step).collect();
    let middle = some.len() / 2;
    let median = some.select_nth_unstable_by(middle, f32::total_cmp).1.max(1e-6);
    values.par_iter_mut().for_each(|v| *v = (1.0 + *v / median).ln());
    Image::new(photo.width(), photo.height(), values)
}

/// An edge of the small picture.
struct Edge {
    x: f32,
    y: f32,
    /// Unit gradient.
    gradient: [f32; 2],
}

/// Circles in pixels of the photo, the likeliest first.
fn candidates(grey: &Image<f32>) -> Vec<BallCircle> {
    let longer = grey.width().max(grey.height());
    let factor = (longer as f64 / SMALL_SIDE as f64).max(1.0);
    let small_side = |side: usize| ((side as f64 / factor).round() as usize).max(1);
    let as_colour = grey.map(|&v| [v; 3]);
    let small = resize(&as_colour, small_side(grey.width()), small_side(grey.height())).map(|rgb| rgb[0]);
    let [width, height] = [small.width(), small.height()];
    let edges = edges(&smoothed(&small));
    let shorter = width.min(height) as f64;
    let radii = [(RADII[0] * shorter).max(5.0), RADII[1] * width.max(height) as f64];
    if edges.len() < 20 || radii[0] >= radii[1] {
        return Vec::new();
    }
    let mut circles: Vec<(f64, BallCircle)> = peaks(&edges, [width, height], radii)
        .into_par_iter()
        .flat_map_iter(|[x, y]| best_radii(&edges, [x, y], [width, height], radii))
        .collect();
    circles.sort_by(|a, b| b.0.total_cmp(&a.0));
    let scale = [grey.width() as f64 / width as f64, grey.height() as f64 / height as f64];
    let mut kept: Vec<BallCircle> = Vec::new();
    for (_, circle) in circles {
        let near = |other: &BallCircle| {
            (other.x - circle.x).hypot(other.y - circle.y) < 3.0 && (other.radius_px - circle.radius_px).abs() < 3.0
        };
        if !kept.iter().any(near) {
            kept.push(circle);
        }
        if kept.len() == FITTED {
            break;
        }
    }
    let in_photo = |c: BallCircle| BallCircle {
        x: c.x * scale[0],
        y: c.y * scale[1],
        radius_px: c.radius_px * (scale[0] * scale[1]).sqrt(),
    };
    kept.into_iter().map(in_photo).collect()
}

/// Binomial, 5 × 5.
fn smoothed(image: &Image<f32>) -> Image<f32> {
    let [width, height] = [image.width(), image.height()];
    let taps = [1.0 / 16.0, 4.0 / 16.0, 6.0 / 16.0, 4.0 / 16.0, 1.0 / 16.0];
    let at = |position: usize, offset: usize, count: usize| (position + offset).saturating_sub(2).min(count - 1);
    let across =
        Image::from_fn(width, height, |x, y| (0..5).map(|i| taps[i] * image[(at(x, i, width), y)]).sum::<f32>());
    Image::from_fn(width, height, |x, y| (0..5).map(|i| taps[i] * across[(x, at(y, i, height))]).sum::<f32>())
}

/// The strongest gradients (central differences) that are the greatest ones across their own edge.
fn edges(image: &Image<f32>) -> Vec<Edge> {
    let [width, height] = [image.width(), image.height()];
    if width < 3 || height < 3 {
        return Vec::new();
    }
    let gradients = Image::from_fn(width, height, |x, y| {
        if x == 0 || y == 0 || x + 1 == width || y + 1 == height {
            return [0.0; 2];
        }
        [image[(x + 1, y)] - image[(x - 1, y)], image[(x, y + 1)] - image[(x, y - 1)]]
    });
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
        let beside = |sign: isize| strength[(x.wrapping_add_signed(sign * dx), y.wrapping_add_signed(sign * dy))];
        if s >= beside(1) && s >= beside(-1) {
            edges.push(Edge { x: x as f32 + 0.5, y: y as f32 + 0.5, gradient: [gx, gy] });
        }
    }
    edges
}

/// Places where most lines along gradients meet.
fn peaks(edges: &[Edge], [width, height]: [usize; 2], radii: [f64; 2]) -> Vec<[f32; 2]> {
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
    found.into_iter().take(PEAKS).map(|(_, at)| at).collect()
}

/// The two radii around a middle whose circles have edges in most sectors, beyond what chance gives a circle of that length.
fn best_radii(
    edges: &[Edge],
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
        if along.abs() >= ALIGNED {
            let turn = dy.atan2(dx) / std::f32::consts::TAU + 0.5;
            let sector = ((turn * SECTORS as f32) as usize).min(SECTORS - 1);
            sectors[distance as usize] |= 1 << sector;
            lengths[distance as usize] += 1.0;
        }
    }
    // aligned edges per pixel around this middle
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
        .filter(|(_, circle)| inside(circle.radius_px) >= LEAST_INSIDE)
        .collect()
}

/// Of the outline, at least this share lies in the photo.
const LEAST_INSIDE: f64 = 0.6;

/// Fits edges across the outline, from far to near.
fn refined(grey: &Image<f32>, circle: BallCircle, lens: BallLens, size: [usize; 2]) -> Option<BallFind> {
    let mut view = BallView::new(circle, lens, size).ok()?;
    let small_pixel = (size[0].max(size[1]) as f64 / SMALL_SIDE as f64).max(1.0);
    for (band, scale) in [(4.0, 2.0), (2.5, 1.0), (1.5, 0.5), (1.0, 0.3), (1.0, 0.3)] {
        let radius = view.circle().radius_px;
        let band_px = band * small_pixel + 0.01 * radius + 2.0;
        let points = edges_across(grey, &view, band_px, small_pixel);
        let tukey_px = scale * small_pixel + 1.0 + 0.003 * radius;
        for _ in 0..6 {
            let middle = [view.circle().x, view.circle().y];
            let weighted: Vec<([f64; 2], f64)> = points
                .iter()
                .filter_map(|crossing| {
                    let at = view.outline(crossing.turn)?;
                    let offset = distance(crossing.point, middle) - distance(at, middle);
                    let share = 1.0 - (offset / tukey_px).powi(2);
                    (share > 0.0).then_some((crossing.point, share * share))
                })
                .collect();
            if weighted.len() < DIRECTIONS / 8 {
                return None;
            }
            view = view.fitted(&weighted)?;
        }
        let BallCircle { x, y, radius_px } = view.circle();
        // a fit that ran away is no find
        BallView::new(BallCircle { x, y, radius_px }, lens, size).ok()?;
    }
    Some(BallFind { view, confidence: confidence(grey, &view, small_pixel) })
}

fn distance(a: [f64; 2], b: [f64; 2]) -> f64 {
    (a[0] - b[0]).hypot(a[1] - b[1])
}

/// An edge on a line across the outline.
struct Crossing {
    turn: f64,
    point: [f64; 2],
}

/// Edges on lines from the middle through the outline, to `band_px` on both of its sides: maxima of the difference between the means of a
/// few pixels on both sides of a point, with at least half of the line's greatest one.
fn edges_across(grey: &Image<f32>, view: &BallView, band_px: f64, small_pixel: f64) -> Vec<Crossing> {
    let middle = [view.circle().x, view.circle().y];
    let step = 0.5;
    // wide enough to average noise, narrow enough to place an edge
    let reach = ((1.0 + 0.5 * small_pixel.min(3.0)) / step).round() as usize;
    let count = (2.0 * band_px / step).ceil() as usize + 2 * reach + 1;
    let mut lines = Vec::new();
    for turn in turns(DIRECTIONS) {
        let Some(at) = view.outline(turn) else { continue };
        let radius = distance(at, middle).max(1e-9);
        let way = [(at[0] - middle[0]) / radius, (at[1] - middle[1]) / radius];
        let place = |index: f64| {
            let offset = (index - 0.5 * (count - 1) as f64) * step;
            [at[0] + offset * way[0], at[1] + offset * way[1]]
        };
        let ends = [place(0.0), place((count - 1) as f64)];
        let inside =
            |p: &[f64; 2]| p[0] >= 0.0 && p[1] >= 0.0 && p[0] <= grey.width() as f64 && p[1] <= grey.height() as f64;
        if !ends.iter().all(inside) {
            continue;
        }
        let mut sums = vec![0.0f64; count + 1];
        for index in 0..count {
            let [x, y] = place(index as f64);
            sums[index + 1] = sums[index] + f64::from(bilinear(grey, x, y));
        }
        let slopes: Vec<f64> = (reach..=count - reach)
            .map(|i| ((sums[i + reach] - sums[i]) - (sums[i] - sums[i - reach])).abs() / reach as f64)
            .collect();
        lines.push((turn, way, at, slopes));
    }
    let mut all: Vec<f64> = lines.iter().flat_map(|(.., slopes)| slopes.iter().copied()).collect();
    if all.is_empty() {
        return Vec::new();
    }
    let middle_slope = all.len() / 2;
    let typical = *all.select_nth_unstable_by(middle_slope, f64::total_cmp).1;
    let mut crossings = Vec::new();
    for (turn, way, at, slopes) in &lines {
        let greatest = slopes.iter().copied().fold(0.0, f64::max);
        for i in 1..slopes.len().saturating_sub(1) {
            let [before, here, after] = [slopes[i - 1], slopes[i], slopes[i + 1]];
            if here < before || here <= after || here < 0.5 * greatest || here < 1.5 * typical || here < 1e-4 {
                continue;
            }
            let curve = before - 2.0 * here + after;
            let peak = if curve < 0.0 { 0.5 * (before - after) / curve } else { 0.0 };
            // sums[i] ends before sample i: the edge lies half a sample before it
            let index = (i + reach) as f64 + peak - 0.5;
            let offset = (index - 0.5 * (count - 1) as f64) * step;
            crossings.push(Crossing { turn: *turn, point: [at[0] + offset * way[0], at[1] + offset * way[1]] });
        }
    }
    crossings
}

/// Share of the directions within the photo in which an edge lies on the outline, less what chance would give.
fn confidence(grey: &Image<f32>, view: &BallView, small_pixel: f64) -> f64 {
    let middle = [view.circle().x, view.circle().y];
    let near_px = ON_OUTLINE_PX.max(0.004 * view.circle().radius_px);
    let band_px = 6.0 * near_px;
    let mut on = [false; DIRECTIONS];
    for crossing in edges_across(grey, view, band_px, small_pixel) {
        let Some(at) = view.outline(crossing.turn) else { continue };
        if (distance(crossing.point, middle) - distance(at, middle)).abs() <= near_px {
            on[((crossing.turn / std::f64::consts::TAU * DIRECTIONS as f64).round() as usize) % DIRECTIONS] = true;
        }
    }
    on.iter().filter(|on| **on).count() as f64 / DIRECTIONS as f64
}

fn bilinear(image: &Image<f32>, x: f64, y: f64) -> f32 {
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
