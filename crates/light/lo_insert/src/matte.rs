//! Soft edges where real surfaces hide the object.
//!
//! A depth map tells which surfaces stand before the object, but not to a pixel where they end: it is coarser than the photo, smeared
//! over some of its pixels, shifted, or has holes there. So along its edges the photo decides. In a band around the steps of depth at
//! which what hides the object ends, the share of each pixel that is hidden minimises
//! `Σ λᵢ (αᵢ − qᵢ)² + Σ wᵢⱼ (αᵢ − αⱼ)²`: random walks with priors (Grady 2005), which like to end at the photo's edges
//! (weights as of Rother et al. 2004), towards what depth and the colours of both sides say. Everywhere else depth decides alone.

use lo_geometry::{Camera, Ray, Vec3};
use rayon::prelude::*;

use crate::colour_sides::ColourSides;
use crate::nearest::nearest_seeds;
use crate::object::Object;
use crate::occluders::Occluders;

/// Half width of the band, in depth pixels, and at least, in photo pixels.
const BAND: (f32, f32) = (3.0, 4.0);

/// Holes are part of the band up to this multiple of its half width.
const HOLE_BAND: f32 = 4.0;

/// Colours are learned in cells of this multiple of the band's half width.
const CELL: f32 = 1.0;

/// Weight of what depth says at the band's end; it grows with the square of the distance from the step.
const DEPTH_WEIGHT: f32 = 1.0;

/// Weight of what colours say where they are sure.
const COLOUR_WEIGHT: f32 = 0.3;

/// Weight between neighbours of very different colours; that of equal ones is 1 more.
const LEAST_LINK: f32 = 0.003;

/// Sweeps of the relaxation, and how far each goes beyond its aim.
const SWEEPS: usize = 60;
const OVER_RELAXATION: f32 = 1.7;

/// Slope with which shares are taken apart about a half, so that edges are as wide as a pixel.
const CONTRAST: f32 = 2.0;

/// Surfaces further apart than this share of their depth, or this multiple of its error, are two.
const GAP: (f32, f32) = (0.02, 3.0);

/// What is known of a pixel by depth alone.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Label {
    /// Nothing of the object is near.
    Off,
    /// No reading.
    Hole,
    Free,
    Hidden,
}

/// Shares in a window of the photo.
pub(crate) struct Matte {
    left: usize,
    top: usize,
    width: usize,
    /// Row by row; NaN where depth alone decides.
    hidden: Vec<f32>,
}

impl Matte {
    /// For an object that is seen in the photo pixels `window` (left, top, right, bottom, the last two exclusive). `colour`: of a pixel,
    /// in sRGB's range.
    pub fn new(
        camera: &Camera,
        object: &Object,
        occluders: &Occluders,
        colour: impl Fn(usize, usize) -> Vec3 + Sync,
        window: (usize, usize, usize, usize),
    ) -> Self {
        let band = (BAND.0 * occluders.depth_pixel).max(BAND.1);
        let cell = (CELL * band).ceil() as usize;
        let margin = 2 * cell;
        let (left, top) = (window.0.saturating_sub(margin), window.1.saturating_sub(margin));
        let (right, bottom) =
            ((window.2 + margin).min(camera.width as usize), (window.3 + margin).min(camera.height as usize));
        let (width, height) = (right - left, bottom - top);
        let none = Self { left, top, width, hidden: Vec::new() };
        let at = |i: usize| (left + i % width, top + i / width);
        let near = near_steps(occluders, camera, (left, top, width, height), HOLE_BAND.max(3.0) * band);
        if !near.contains(&true) {
            return none;
        }
        // The object's depth, continued beyond its outline.
        let ray = |i: usize| {
            let (x, y) = at(i);
            Ray { origin: Vec3::ZERO, direction: camera.direction(x as f64 + 0.5, y as f64 + 0.5) }
        };
        let seen_m = |i: usize| {
            let ray = ray(i);
            object.seen(&ray, 0.0).map(|hit| -ray.at(hit.distance_m).z)
        };
        let own_m: Vec<Option<f32>> =
            (0..width * height).into_par_iter().map(|i| near[i].then(|| seen_m(i)).flatten()).collect();
        let continued = nearest_seeds(width, height, |i| own_m[i].is_some());
        let relative = |i: usize| {
            let (x, y) = at(i);
            ((x as f64 + 0.5) / f64::from(camera.width), (y as f64 + 0.5) / f64::from(camera.height))
        };
        let labels: Vec<(Label, f32)> = (0..width * height)
            .into_par_iter()
            .map(|i| {
                let object_m = continued[i].filter(|(_, distance)| near[i] && *distance <= margin as f32);
                let Some(object_m) = object_m.and_then(|(seed, _)| own_m[seed]) else { return (Label::Off, 0.0) };
                let (u, v) = relative(i);
                let Some(reading_m) = occluders.depth_m(u, v) else { return (Label::Hole, 0.0) };
                let direction = ray(i).direction;
                let point = direction * (object_m / -direction.z);
                let hidden = occluders.hides(u, v, point, object.support.as_ref());
                (if hidden { Label::Hidden } else { Label::Free }, reading_m)
            })
            .collect();

        // Where what hides the object ends.
        let ends = |i: usize, j: usize| match (labels[i], labels[j]) {
            ((Label::Hidden, near_m), (Label::Free, far_m)) => {
                far_m - near_m > (GAP.0 * near_m).max(GAP.1 * occluders.bias_m(near_m))
            }
            ((Label::Hidden, _), (Label::Hole, _)) => true,
            _ => false,
        };
        let neighbours = |i: usize| {
            let (x, y) = (i % width, i / width);
            [
                (x > 0).then(|| i - 1),
                (x + 1 < width).then_some(i + 1),
                (y > 0).then(|| i - width),
                (y + 1 < height).then_some(i + width),
            ]
            .into_iter()
            .flatten()
        };
        let is_end: Vec<bool> =
            (0..width * height).into_par_iter().map(|i| neighbours(i).any(|j| ends(i, j) || ends(j, i))).collect();
        if !is_end.contains(&true) {
            return none;
        }
        let distances = nearest_seeds(width, height, |i| is_end[i]);
        let distance = |i: usize| distances[i].map_or(f32::INFINITY, |(_, distance)| distance);
        let is_open = |i: usize| match labels[i].0 {
            Label::Off => false,
            Label::Hole => distance(i) <= HOLE_BAND * band,
            Label::Free | Label::Hidden => distance(i) <= band,
        };
        let open: Vec<usize> = (0..width * height).filter(|&i| is_open(i)).collect();

        // Colours of both sides; those right at a step may be on the wrong one.
        let sure = |i: usize| ((distance(i) + 0.5) / band).min(1.0);
        let colours: Vec<Vec3> = (0..width * height)
            .into_par_iter()
            .map(|i| if labels[i].0 == Label::Off { Vec3::ZERO } else { colour(at(i).0, at(i).1) })
            .collect();
        let samples = (0..width * height).filter_map(|i| {
            let weight = sure(i) * sure(i);
            let weights = match labels[i].0 {
                Label::Hidden => [weight, 0.0],
                Label::Free => [0.0, weight],
                Label::Hole | Label::Off => return None,
            };
            Some((i % width, i / width, colours[i], weights))
        });
        let sides = ColourSides::new((width, height), cell, samples);

        let mut share: Vec<f32> = labels
            .iter()
            .map(|(label, _)| match label {
                Label::Hidden => 1.0,
                Label::Hole | Label::Free | Label::Off => 0.0,
            })
            .collect();
        let priors: Vec<(f32, f32)> = open
            .par_iter()
            .map(|&i| {
                let by_colour = 1.0 / (1.0 + (-sides.log_ratio(i % width, i / width, colours[i])).exp());
                let colour_weight = COLOUR_WEIGHT * (2.0 * by_colour - 1.0).powi(2);
                let depth_weight = if labels[i].0 == Label::Hole { 0.0 } else { DEPTH_WEIGHT * (distance(i) / band).powi(2) };
                let weight = depth_weight + colour_weight + 1e-6;
                (weight, (depth_weight * share[i] + colour_weight * by_colour + 0.5e-6) / weight)
            })
            .collect();
        let difference = |i: usize, j: usize| colours[i].distance_squared(colours[j]);
        let mean = open
            .iter()
            .flat_map(|&i| neighbours(i).map(move |j| (i, j)))
            .filter(|&(_, j)| labels[j].0 != Label::Off)
            .fold((0.0f64, 0u32), |sum, (i, j)| (sum.0 + f64::from(difference(i, j)), sum.1 + 1));
        let steepness = 0.5 / (mean.0 / f64::from(mean.1.max(1))).max(1e-6) as f32;
        let links: Vec<[f32; 2]> = (0..width * height)
            .into_par_iter()
            .map(|i| {
                let link = |j: usize| {
                    let off = labels[i].0 == Label::Off || labels[j].0 == Label::Off;
                    if off { 0.0 } else { LEAST_LINK + (-steepness * difference(i, j)).exp() }
                };
                [
                    if i % width + 1 < width { link(i + 1) } else { 0.0 },
                    if i + width < width * height { link(i + width) } else { 0.0 },
                ]
            })
            .collect();
        for (&i, &(_, prior)) in open.iter().zip(&priors) {
            share[i] = prior;
        }
        for sweep in 0..SWEEPS {
            let relax = |k: usize| {
                let (i, (weight, prior)) = (open[k], priors[k]);
                let mut sum = (weight * prior, weight);
                let mut add = |j: usize, link: f32| {
                    sum.0 += link * share[j];
                    sum.1 += link;
                };
                if i % width > 0 {
                    add(i - 1, links[i - 1][0]);
                }
                if i % width + 1 < width {
                    add(i + 1, links[i][0]);
                }
                if i >= width {
                    add(i - width, links[i - width][1]);
                }
                if i + width < width * height {
                    add(i + width, links[i][1]);
                }
                share[i] = (share[i] + OVER_RELAXATION * (sum.0 / sum.1 - share[i])).clamp(0.0, 1.0);
            };
            if sweep % 2 == 0 { (0..open.len()).for_each(relax) } else { (0..open.len()).rev().for_each(relax) }
        }
        let mut hidden = vec![f32::NAN; width * height];
        for &i in &open {
            hidden[i] = (0.5 + CONTRAST * (share[i] - 0.5)).clamp(0.0, 1.0);
        }
        Self { hidden, ..none }
    }

    /// Share of a photo pixel that real surfaces hide of the object there; `None` where depth alone tells.
    pub fn hidden(&self, (x, y): (usize, usize)) -> Option<f32> {
        let (x, y) = (x.checked_sub(self.left)?, y.checked_sub(self.top)?);
        let share = *self.hidden.get(y * self.width + x).filter(|_| x < self.width)?;
        (!share.is_nan()).then_some(share)
    }
}

/// Which pixels of a window `(left, top, width, height)` are within `reach` of a depth pixel of a step or hole.
fn near_steps(
    occluders: &Occluders,
    camera: &Camera,
    (left, top, width, height): (usize, usize, usize, usize),
    reach: f32,
) -> Vec<bool> {
    let steps = occluders.steps();
    let (columns, rows) = steps.size();
    let (sx, sy) = (columns as f32 / camera.width as f32, rows as f32 / camera.height as f32);
    let (reach_x, reach_y) = ((reach * sx).ceil() as usize + 1, (reach * sy).ceil() as usize + 1);
    // Depth pixels of the window, grown by the reach; a running count along rows, then along columns.
    let spread = |count: usize, step: usize, lines: usize, line: usize, reach: usize, set: &[bool]| {
        let mut grown = vec![false; set.len()];
        for l in 0..lines {
            let mut within = 0usize;
            for k in 0..count + reach {
                within += usize::from(k < count && set[l * line + k * step]);
                if let Some(gone) = k.checked_sub(2 * reach + 1) {
                    within -= usize::from(gone < count && set[l * line + gone * step]);
                }
                if let Some(middle) = k.checked_sub(reach) {
                    grown[l * line + middle * step] = within > 0;
                }
            }
        }
        grown
    };
    let set: Vec<bool> = (0..columns * rows).map(|i| steps.is_open(i % columns, i / columns)).collect();
    let set = spread(columns, 1, rows, columns, reach_x, &set);
    let set = spread(rows, columns, columns, 1, reach_y, &set);
    (0..width * height)
        .map(|i| {
            let (x, y) = (left + i % width, top + i / width);
            let (x, y) = (((x as f32 + 0.5) * sx) as usize, ((y as f32 + 0.5) * sy) as usize);
            set[y.min(rows - 1) * columns + x.min(columns - 1)]
        })
        .collect()
}
