//! Soft edges where real surfaces hide an object.
//!
//! Depth shows which surfaces are in front of the object, but not exactly where they end: it is coarser than the
//! photo, smeared, shifted, or has holes at edges. Along these edges the photo decides. In a band around the depth
//! steps at which occluders end, the hidden share of each pixel minimises `Σ λᵢ (αᵢ − qᵢ)² + Σ wᵢⱼ (αᵢ − αⱼ)²`:
//! random walks with priors (Grady 2005), which tend to end at the photo's edges (weights as in Rother et al. 2004).
//! The priors q come from depth and from the colours of both sides. Elsewhere depth alone decides.

use lo_geometry::{Camera, Ray, Vec3};
use rayon::prelude::*;

use crate::matte::colour_sides::ColourSides;
use crate::matte::nearest::nearest_seeds;
use crate::matte::walk::{UnknownPixel, solve_random_walk};
use crate::objects::object::Object;
use crate::surface::occluders::Occluders;

/// Half width of the band in depth pixels, and its minimum in photo pixels.
const BAND: (f32, f32) = (3.0, 4.0);

/// Multiple of the band's half width up to which holes belong to it.
const HOLE_BAND: f32 = 8.0;

/// Weight of depth far from the step; it grows with the square of the distance.
const DEPTH_WEIGHT: f32 = 4.0;

/// Weight of depth in holes beside surfaces that do not hide the object: surfaces that a near one shadows from the
/// sensor are behind it.
const HOLE_WEIGHT: f32 = 0.05;

/// Weight of colours where they are conclusive.
const COLOUR_WEIGHT: f32 = 0.1;

/// Weight between neighbours of very different colours; that of equal ones is 1 more.
const MIN_LINK: f32 = 0.003;

/// Slope that pushes shares away from one half, so that edges are as wide as a pixel.
const CONTRAST: f32 = 2.0;

/// Pixels on each side of an edge pixel from which the colours in front of and behind it are taken.
const AROUND: isize = 3;

/// Smallest gap between two surfaces: share of their depth, and multiple of its error.
const GAP: (f32, f32) = (0.02, 3.0);

/// Trimap label of a pixel, from depth alone.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum TrimapLabel {
    /// Far from the object or from a step.
    Off,
    /// No reading.
    Hole,
    Free,
    Hidden,
}

/// Hidden shares in a window of the photo.
pub(crate) struct Matte {
    left: usize,
    top: usize,
    width: usize,
    /// Hidden shares, row by row; NaN where depth alone decides. Empty if it does so everywhere.
    hidden: Vec<f32>,
    /// Photo pixels of soft edges with the occluder's colour, separated from the background.
    pub occluder_colours: Vec<((usize, usize), Vec3)>,
}

impl Matte {
    /// Computes the matte of an object visible in the photo pixels `window` (left, top, right, bottom, the last two
    /// exclusive). `colour` returns the colour of a pixel in sRGB's range.
    pub fn new(
        camera: &Camera,
        object: &Object,
        occluders: &Occluders,
        colour: impl Fn((usize, usize)) -> Vec3 + Sync,
        window: (usize, usize, usize, usize),
    ) -> Self {
        let band = (BAND.0 * occluders.depth_pixel).max(BAND.1);
        let view = View::new(camera, band, window);
        let none = Self {
            left: view.left,
            top: view.top,
            width: view.width,
            hidden: Vec::new(),
            occluder_colours: Vec::new(),
        };
        let Some(labels) = view.labels(object, occluders) else { return none };
        let Some(band) = Band::new(&view, labels, occluders) else { return none };
        let colours: Vec<Vec3> = (0..view.len())
            .into_par_iter()
            .map(|i| if band.labels[i].0 == TrimapLabel::Off { Vec3::ZERO } else { colour(view.photo_pixel(i)) })
            .collect();
        let (open, links) = (band.open(&view, &colours), band.links(&view, &colours));
        let known =
            band.labels.iter().map(|(label, _)| if *label == TrimapLabel::Hidden { 1.0 } else { 0.0 }).collect();
        let share = solve_random_walk(known, view.width, &open, &links);
        let shares: Vec<f32> = share.iter().map(|share| (0.5 + CONTRAST * (share - 0.5)).clamp(0.0, 1.0)).collect();
        let front = |open: &UnknownPixel| {
            Some((view.photo_pixel(open.pixel), band.front(&view, &shares, &colours, open.pixel)?))
        };
        let occluder_colours = open.par_iter().filter_map(front).collect();
        let mut hidden = vec![f32::NAN; view.len()];
        for UnknownPixel { pixel, .. } in open {
            hidden[pixel] = shares[pixel];
        }
        Self { hidden, occluder_colours, ..none }
    }

    /// Returns the share of a photo pixel in which real surfaces hide the object; `None` where depth alone decides.
    pub fn hidden(&self, (x, y): (usize, usize)) -> Option<f32> {
        let (x, y) = (x.checked_sub(self.left)?, y.checked_sub(self.top)?);
        let share = *self.hidden.get(y * self.width + x).filter(|_| x < self.width)?;
        (!share.is_nan()).then_some(share)
    }
}

/// The window, grown by the margin from which colours are learned. Pixels are numbered row by row.
struct View<'a> {
    camera: &'a Camera,
    left: usize,
    top: usize,
    width: usize,
    height: usize,
    /// Half width of the band in pixels.
    band: f32,
    /// Pixels by which the window is grown.
    margin: usize,
}

impl<'a> View<'a> {
    fn new(camera: &'a Camera, band: f32, window: (usize, usize, usize, usize)) -> Self {
        let margin = 2 * band.ceil() as usize;
        let (left, top) = (window.0.saturating_sub(margin), window.1.saturating_sub(margin));
        let right = (window.2 + margin).min(camera.width as usize);
        let bottom = (window.3 + margin).min(camera.height as usize);
        Self { camera, left, top, width: right - left, height: bottom - top, band, margin }
    }

    fn len(&self) -> usize {
        self.width * self.height
    }

    /// Returns the pitch of the cells in which colours are learned.
    fn cell(&self) -> usize {
        self.margin / 2
    }

    fn photo_pixel(&self, i: usize) -> (usize, usize) {
        (self.left + i % self.width, self.top + i / self.width)
    }

    /// Returns the relative photo position of a pixel's centre, in [0, 1]².
    fn place(&self, i: usize) -> (f64, f64) {
        let (x, y) = self.photo_pixel(i);
        ((x as f64 + 0.5) / f64::from(self.camera.width), (y as f64 + 0.5) / f64::from(self.camera.height))
    }

    fn neighbours(&self, i: usize) -> impl Iterator<Item = usize> + use<> {
        let (x, y, width, height) = (i % self.width, i / self.width, self.width, self.height);
        let beside = [(x > 0).then(|| i - 1), (x + 1 < width).then(|| i + 1)];
        let above = [(y > 0).then(|| i - width), (y + 1 < height).then(|| i + width)];
        beside.into_iter().chain(above).flatten()
    }

    /// Returns the label and depth of each pixel near a step; `None` if there is no relevant step.
    fn labels(&self, object: &Object, occluders: &Occluders) -> Option<Vec<(TrimapLabel, f32)>> {
        let farthest_m = object.corners().iter().map(|corner| -corner.z).fold(0.0, f32::max);
        let near = self.near_steps(occluders, farthest_m)?;
        let direction = |i: usize| {
            let (x, y) = self.photo_pixel(i);
            self.camera.direction(x as f64 + 0.5, y as f64 + 0.5)
        };
        let seen_m = |i: usize| {
            let ray = Ray { origin: Vec3::ZERO, direction: direction(i) };
            object.seen(&ray, 0.0).map(|hit| -ray.at(hit.distance_m).z)
        };
        // Every second pixel of every second row is enough.
        let asked = |i: usize| {
            let (x, y) = self.photo_pixel(i);
            near[i] && x % 2 == 0 && y % 2 == 0
        };
        let own_m: Vec<Option<f32>> =
            (0..self.len()).into_par_iter().map(|i| asked(i).then(|| seen_m(i)).flatten()).collect();
        // Continue the object's depth between them and beyond its outline.
        let continued = nearest_seeds(self.width, self.height, |i| own_m[i].is_some());
        let label = |i: usize| {
            let seed = continued[i].filter(|(_, distance)| near[i] && *distance <= self.margin as f32);
            let Some(object_m) = seed.and_then(|(seed, _)| own_m[seed]) else { return (TrimapLabel::Off, 0.0) };
            let (u, v) = self.place(i);
            let Some(reading_m) = occluders.depth_m(u, v) else { return (TrimapLabel::Hole, 0.0) };
            let direction = direction(i);
            let hidden = occluders.hides(u, v, direction * (object_m / -direction.z), object.support.as_ref());
            (if hidden { TrimapLabel::Hidden } else { TrimapLabel::Free }, reading_m)
        };
        Some((0..self.len()).into_par_iter().map(label).collect())
    }

    /// Returns which pixels are near enough to an edge of a surface nearer than `farthest_m` to affect the matte.
    fn near_steps(&self, occluders: &Occluders, farthest_m: f32) -> Option<Vec<bool>> {
        let steps = occluders.steps();
        let (columns, rows) = steps.size();
        let scale = [columns as f32 / self.camera.width as f32, rows as f32 / self.camera.height as f32];
        // The band, and the margin from which its colours are learned.
        let reach = if steps.has_holes() { HOLE_BAND + 1.0 } else { 3.0 };
        let reach = scale.map(|scale| (reach * self.band * scale).ceil() as usize + 1);
        let depth_pixel = |x: usize, y: usize| {
            let at = |at: usize, scale: f32, count: usize| (((at as f32 + 0.5) * scale) as usize).min(count - 1);
            (at(x, scale[0], columns), at(y, scale[1], rows))
        };
        // The part of the depth map within the window's reach: set, then dilated along rows and along columns.
        let (first, last) =
            (depth_pixel(self.left, self.top), depth_pixel(self.left + self.width - 1, self.top + self.height - 1));
        let (left, top) = (first.0.saturating_sub(reach[0]), first.1.saturating_sub(reach[1]));
        let (width, height) = ((last.0 + reach[0] + 1).min(columns) - left, (last.1 + reach[1] + 1).min(rows) - top);
        let ends = |i: usize| steps.ends_before(left + i % width, top + i / width, farthest_m);
        let set: Vec<bool> = (0..width * height).map(ends).collect();
        if !set.contains(&true) {
            return None;
        }
        let set = grown(&set, (width, 1), (height, width), reach[0]);
        let set = grown(&set, (height, width), (width, 1), reach[1]);
        let near = |i: usize| {
            let (x, y) = self.photo_pixel(i);
            let (x, y) = depth_pixel(x, y);
            set[(y - top) * width + x - left]
        };
        Some((0..self.len()).map(near).collect())
    }
}

/// Dilates `set` by `reach` along lines of `count` items with stride `step`; there are `lines` of them with stride
/// `line_step`.
fn grown(set: &[bool], (count, step): (usize, usize), (lines, line_step): (usize, usize), reach: usize) -> Vec<bool> {
    let mut grown = vec![false; set.len()];
    for line in 0..lines {
        let mut within = 0usize;
        for k in 0..count + reach {
            let is_set = |k: usize| k < count && set[line * line_step + k * step];
            within += usize::from(is_set(k));
            within -= usize::from(k.checked_sub(2 * reach + 1).is_some_and(is_set));
            if let Some(middle) = k.checked_sub(reach) {
                grown[line * line_step + middle * step] = within > 0;
            }
        }
    }
    grown
}

/// Pixels around the depth steps at which occluders end.
struct Band {
    labels: Vec<(TrimapLabel, f32)>,
    /// Distance from the nearest step, in pixels.
    distances: Vec<f32>,
    /// Whether a surface that does not hide the object is near.
    beside_free: Vec<bool>,
}

impl Band {
    /// Builds the band; returns `None` if it is empty.
    fn new(view: &View, labels: Vec<(TrimapLabel, f32)>, occluders: &Occluders) -> Option<Self> {
        let ends = |i: usize, j: usize| match (labels[i], labels[j]) {
            ((TrimapLabel::Hidden, near_m), (TrimapLabel::Free, far_m)) => {
                far_m - near_m > (GAP.0 * near_m).max(GAP.1 * occluders.bias_m(near_m))
            }
            ((TrimapLabel::Hidden, _), (TrimapLabel::Hole, _)) => true,
            _ => false,
        };
        let is_end: Vec<bool> = (0..view.len())
            .into_par_iter()
            .map(|i| labels[i].0 != TrimapLabel::Off && view.neighbours(i).any(|j| ends(i, j) || ends(j, i)))
            .collect();
        if !is_end.contains(&true) {
            return None;
        }
        let distances = nearest_seeds(view.width, view.height, |i| is_end[i]);
        let distances = distances.into_iter().map(|nearest| nearest.map_or(f32::INFINITY, |(_, d)| d)).collect();
        let free = nearest_seeds(view.width, view.height, |i| labels[i].0 == TrimapLabel::Free);
        let beside_free = free.into_iter().map(|nearest| nearest.is_some_and(|(_, d)| d <= HOLE_BAND * view.band));
        Some(Self { beside_free: beside_free.collect(), labels, distances })
    }

    /// Returns the pixels that the photo decides, with the priors from depth and colours.
    fn open(&self, view: &View, colours: &[Vec3]) -> Vec<UnknownPixel> {
        let depths = LabelDistances::new(view, &self.labels, &self.distances);
        // Certainty of a pixel, in [0, 1]: its distance from the step relative to the largest nearby on its side. The
        // middle of a thin pole is certain.
        let sure = |i: usize| {
            let deepest = depths.around(i % view.width, i / view.width, self.labels[i].0).clamp(1.0, view.band);
            ((self.distances[i] + 0.5) / (deepest + 0.5)).min(1.0).powi(2)
        };
        let samples = (0..view.len()).filter_map(|i| {
            let weights = match self.labels[i].0 {
                TrimapLabel::Hidden => [sure(i), 0.0],
                TrimapLabel::Free => [0.0, sure(i)],
                TrimapLabel::Hole | TrimapLabel::Off => return None,
            };
            Some((i % view.width, i / view.width, colours[i], weights))
        });
        let sides = ColourSides::new((view.width, view.height), view.cell(), samples);
        let open = |i: usize| {
            let (reach, weight, by_depth) = match self.labels[i].0 {
                TrimapLabel::Off => return None,
                TrimapLabel::Hole => (HOLE_BAND, if self.beside_free[i] { HOLE_WEIGHT } else { 0.0 }, 0.0),
                TrimapLabel::Free => (1.0, DEPTH_WEIGHT * sure(i), 0.0),
                TrimapLabel::Hidden => (1.0, DEPTH_WEIGHT * sure(i), 1.0),
            };
            if self.distances[i] > reach * view.band {
                return None;
            }
            let by_colour = 1.0 / (1.0 + (-sides.log_ratio(i % view.width, i / view.width, colours[i])).exp());
            let colour_weight = COLOUR_WEIGHT * (2.0 * by_colour - 1.0).powi(2);
            // A small weight keeps unconstrained pixels between both labels.
            let sum = weight + colour_weight + 1e-6;
            Some(UnknownPixel {
                pixel: i,
                weight: sum,
                prior: (weight * by_depth + colour_weight * by_colour + 0.5e-6) / sum,
            })
        };
        (0..view.len()).into_par_iter().filter_map(open).collect()
    }

    /// Returns the occluder's colour at a pixel of a soft edge: the pixel's colour without the background's part,
    /// clamped to the range of nearby pixels that are fully hidden. `None` if the pixel shows one side only, or has
    /// no reference pixels around it.
    fn front(&self, view: &View, shares: &[f32], colours: &[Vec3], i: usize) -> Option<Vec3> {
        let share = shares[i];
        if share <= 0.0 || share >= 1.0 {
            return None;
        }
        let (x, y) = ((i % view.width) as isize, (i / view.width) as isize);
        let (mut behind, mut count) = (Vec3::ZERO, 0.0);
        let (mut low, mut high) = (Vec3::INFINITY, Vec3::NEG_INFINITY);
        for py in (y - AROUND).max(0)..(y + AROUND + 1).min(view.height as isize) {
            for px in (x - AROUND).max(0)..(x + AROUND + 1).min(view.width as isize) {
                let j = py as usize * view.width + px as usize;
                if self.labels[j].0 == TrimapLabel::Off {
                    continue;
                }
                if shares[j] <= 0.0 {
                    (behind, count) = (behind + colours[j], count + 1.0);
                } else if shares[j] >= 1.0 {
                    (low, high) = (low.min(colours[j]), high.max(colours[j]));
                }
            }
        }
        let rest = (colours[i] - (1.0 - share) * behind / count) / share;
        (count > 0.0 && low.is_finite()).then(|| rest.max(low).min(high))
    }

    /// Returns the similarity of each pixel to the next of its row and of its column.
    fn links(&self, view: &View, colours: &[Vec3]) -> Vec<[f32; 2]> {
        let is_off = |i: usize| self.labels[i].0 == TrimapLabel::Off;
        let difference = |i: usize, j: usize| colours[i].distance_squared(colours[j]);
        let (mut sum, mut count) = (0.0, 0u32);
        for i in (0..view.len()).filter(|&i| self.distances[i] <= view.band && !is_off(i)) {
            for j in view.neighbours(i).filter(|&j| j > i && !is_off(j)) {
                sum += f64::from(difference(i, j));
                count += 1;
            }
        }
        let steepness = 0.5 / ((sum / f64::from(count.max(1))) as f32).max(1e-6);
        let link = |i: usize, j: usize| {
            let together = !is_off(i) && !is_off(j);
            if together { MIN_LINK + (-steepness * difference(i, j)).exp() } else { 0.0 }
        };
        let links = |i: usize| {
            let right = if i % view.width + 1 < view.width { link(i, i + 1) } else { 0.0 };
            let below = if i + view.width < view.len() { link(i, i + view.width) } else { 0.0 };
            [right, below]
        };
        (0..view.len()).into_par_iter().map(links).collect()
    }
}

/// Largest distances from the step of free and hidden pixels, by cells of a grid.
struct LabelDistances {
    cell: usize,
    columns: usize,
    rows: usize,
    /// Distances of free and of hidden pixels.
    farthest: Vec<[f32; 2]>,
}

impl LabelDistances {
    fn new(view: &View, labels: &[(TrimapLabel, f32)], distances: &[f32]) -> Self {
        let cell = view.cell().div_ceil(2);
        let (columns, rows) = (view.width.div_ceil(cell), view.height.div_ceil(cell));
        let mut farthest = vec![[0.0f32; 2]; columns * rows];
        for (i, ((label, _), &distance)) in labels.iter().zip(distances).enumerate() {
            let farthest = &mut farthest[i / view.width / cell * columns + i % view.width / cell];
            match label {
                TrimapLabel::Free => farthest[0] = farthest[0].max(distance),
                TrimapLabel::Hidden => farthest[1] = farthest[1].max(distance),
                TrimapLabel::Off | TrimapLabel::Hole => {}
            }
        }
        Self { cell, columns, rows, farthest }
    }

    /// Returns the largest distance of a label in the cells around a pixel.
    fn around(&self, x: usize, y: usize, label: TrimapLabel) -> f32 {
        let near = |at: usize, count: usize| at.saturating_sub(1)..(at + 2).min(count);
        near(y / self.cell, self.rows)
            .flat_map(|y| near(x / self.cell, self.columns).map(move |x| (x, y)))
            .map(|(x, y)| self.farthest[y * self.columns + x][usize::from(label == TrimapLabel::Hidden)])
            .fold(0.0, f32::max)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_set_grows_by_its_reach() {
        let (width, height) = (9, 5);
        let mut set = vec![false; width * height];
        set[2 * width + 4] = true;
        set[4 * width] = true;
        let rows = grown(&set, (width, 1), (height, width), 2);
        let both = grown(&rows, (height, width), (width, 1), 1);
        for (i, found) in both.into_iter().enumerate() {
            let near = |(x, y): (usize, usize)| (i % width).abs_diff(x) <= 2 && (i / width).abs_diff(y) <= 1;
            assert_eq!(found, near((4, 2)) || near((0, 4)), "{i}");
        }
    }
}
