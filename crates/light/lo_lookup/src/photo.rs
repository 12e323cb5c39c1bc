//! The photo's radiance at every scale, with clipped pixels restored from the octree.

use lo_cone::{Cone, ConeSample, ConeTracer};
use lo_geometry::{Vec2, Vec3};
use lo_imaging::{Image, RadianceImage};
use lo_lights::ImageChange;
use lo_scene::Frame;
use rayon::prelude::*;

/// Longer side of the finest level.
const MAX_SIDE: usize = 2048;

/// Greatest number of taps along the longer axis of a footprint.
const MAX_TAPS: f32 = 6.0;

/// Pixels of the level that is read, over the width of the footprint. A box has this root mean square at 0.7.
const WIDTH_SHARE: f32 = 0.7;

/// Cells per leaf width in which clipped pixels are compared with the octree.
const CELLS_PER_LEAF: f32 = 2.0;

/// Share of its surroundings that a clipped region must have to receive all of the difference.
const MIN_SHARE: f32 = 0.05;

/// Relative difference of octree and photo outside clipped regions, because they are averaged differently.
const ERROR: f32 = 0.3;

/// A mip pyramid (Williams 1983) of linear radiance.
pub(crate) struct PhotoPyramid {
    /// Finest first, each half as wide and high as the one before.
    levels: Vec<RadianceImage>,
}

impl PhotoPyramid {
    /// Builds the pyramid of the frame's photo, at most 2048 pixels wide and high.
    ///
    /// `tracer` traces the light that the photo shows, `leaf_edge_m` is the edge of the finest leaves, and `depth_m` a
    /// typical depth. `change` is a light edit to apply to the photo.
    pub fn new(
        frame: &Frame,
        tracer: &ConeTracer,
        leaf_edge_m: f32,
        depth_m: f32,
        change: Option<&ImageChange>,
    ) -> Self {
        let (width, height) = (frame.photo.width(), frame.photo.height());
        let scale = (MAX_SIDE as f32 / width.max(height) as f32).min(1.0);
        let side = |pixels: usize| ((pixels as f32 * scale) as usize).max(1);
        let photo = lo_scene::resized_photo(&frame.photo, side(width), side(height));
        let camera = frame.camera.resized(photo.width() as u32, photo.height() as u32);
        // Depth is not used here.
        let frame = Frame { camera, photo, depth_m: Image::new(1, 1, vec![depth_m]), exposure: frame.exposure };
        let leaf_px = leaf_edge_m * camera.fx as f32 / depth_m;
        let mut finest = restored(&frame, tracer, (leaf_px / CELLS_PER_LEAF).max(1.0) as usize);
        if let Some(change) = change {
            change.photo(&mut finest, &frame.camera);
        }
        Self::of(finest)
    }

    /// Builds the pyramid of an image in linear values.
    pub fn of(finest: RadianceImage) -> Self {
        let mut levels = vec![finest];
        while let Some(coarser) = levels.last().filter(|level| level.width().min(level.height()) >= 2).map(halved) {
            levels.push(coarser);
        }
        Self { levels }
    }

    /// Returns the finest level whose longer side is at most `side` pixels.
    pub fn level_within(&self, side: usize) -> &RadianceImage {
        let fits = |level: &&RadianceImage| level.width().max(level.height()) <= side;
        self.levels.iter().find(fits).unwrap_or(&self.levels[self.levels.len() - 1])
    }

    /// Returns width and height of the finest level.
    pub fn size(&self) -> Vec2 {
        Vec2::new(self.levels[0].width() as f32, self.levels[0].height() as f32)
    }

    /// Returns the mean radiance over an ellipse, given by its centre and two conjugate half-axes, all in pixels. Taps
    /// along the longer axis are each as wide as the shorter one (Feline, McCormack et al. 1999).
    pub fn mean(&self, at: Vec2, axes: [Vec2; 2]) -> Vec3 {
        let (long, short) = if axes[0].length_squared() > axes[1].length_squared() {
            (axes[0], axes[1].length())
        } else {
            (axes[1], axes[0].length())
        };
        let length = long.length();
        let taps = (length / short.max(0.5)).ceil().clamp(1.0, MAX_TAPS);
        // Bilinear taps are twice as wide as a pixel at their base: this is as wide at half height as the ellipse is on
        // average.
        let level = (WIDTH_SHARE * 2.0 * short.max(length / taps)).max(1.0).log2();
        let tap = |i: usize| self.look_up(at + long * ((2.0 * i as f32 + 1.0) / taps - 1.0), level);
        (0..taps as usize).map(tap).sum::<Vec3>() / taps
    }

    fn look_up(&self, at: Vec2, level: f32) -> Vec3 {
        let level = level.min((self.levels.len() - 1) as f32);
        let finer = level as usize;
        let on = |index: usize| {
            let image = &self.levels[index];
            let scale = Vec2::new(image.width() as f32, image.height() as f32) / self.size();
            bilinear(image, at * scale)
        };
        let share = level - finer as f32;
        if share > 0.0 { on(finer).lerp(on(finer + 1), share) } else { on(finer) }
    }
}

/// Returns the photo's radiance, with clipped pixels raised so that their surroundings match the octree. The octree may
/// know them from completion, a panorama of the room, or the network. Never lowers the photo's values.
///
/// `cell` is the side in pixels of the squares in which both are compared.
fn restored(frame: &Frame, tracer: &ConeTracer, cell: usize) -> RadianceImage {
    let mut radiance = frame.radiance();
    let clipped = frame.clipped();
    if !clipped.pixels().contains(&true) {
        return radiance;
    }
    let (width, height) = (radiance.width(), radiance.height());
    let (columns, rows) = (width.div_ceil(cell), height.div_ceil(cell));
    let mut cells = Image::new(columns, rows, vec![Cell::default(); columns * rows]);
    for y in 0..height {
        for x in 0..width {
            cells[(x / cell, y / cell)].add(Vec3::from(radiance[(x, y)]), clipped[(x, y)]);
        }
    }
    // As wide as the octree spreads a leaf's content: a leaf's box, read with its neighbours.
    let around = Image::from_fn(columns, rows, |x, y| {
        let mut sum = Cell::default();
        for (dy, down) in TENT.into_iter().enumerate() {
            for (dx, across) in TENT.into_iter().enumerate() {
                if let (Some(x), Some(y)) = ((x + dx).checked_sub(2), (y + dy).checked_sub(2))
                    && x < columns
                    && y < rows
                {
                    sum = sum.plus(&cells[(x, y)], down * across);
                }
            }
        }
        sum
    });
    let tan_half_angle = (0.5 * cell as f32 * frame.camera.pixel_angle_rad()).tan();
    let asked: Vec<usize> = (0..columns * rows).filter(|&i| around.pixels()[i].clipped > 0.0).collect();
    let middle = |index: usize, pixels: usize| ((index as f64 + 0.5) * cell as f64).min(pixels as f64);
    let cone = |&i: &usize| Cone {
        origin: Vec3::ZERO,
        direction: frame.camera.direction(middle(i % columns, width), middle(i / columns, height)),
        tan_half_angle,
    };
    let cones: Vec<Cone> = asked.iter().map(cone).collect();
    let mut samples = vec![ConeSample::default(); cones.len()];
    tracer.trace_batch(&cones, &mut samples);
    let mut lacking = Image::new(columns, rows, vec![[0.0; 3]; columns * rows]);
    for (i, sample) in asked.into_iter().zip(&samples) {
        let Cell { light, clipped, pixels } = around.pixels()[i];
        let (light, clipped) = (light / pixels, clipped / pixels);
        // The whole difference is assigned to clipped pixels. Where these are few, only the part that exceeds the error
        // of the rest is.
        let missing = Vec3::from(sample.radiance) - light * (1.0 + ERROR * (1.0 - clipped));
        lacking.pixels_mut()[i] = (missing.max(Vec3::ZERO) / clipped.max(MIN_SHARE)).to_array();
    }
    for y in 0..height {
        for x in 0..width {
            if clipped[(x, y)] {
                let at = (Vec2::new(x as f32, y as f32) + 0.5) / cell as f32;
                let own = Vec3::from(radiance[(x, y)]);
                radiance[(x, y)] = (own + bilinear(&lacking, at)).to_array();
            }
        }
    }
    radiance
}

const TENT: [f32; 5] = [1.0, 2.0, 3.0, 2.0, 1.0];

/// Sums over pixels.
#[derive(Clone, Copy, Default)]
struct Cell {
    light: Vec3,
    clipped: f32,
    pixels: f32,
}

impl Cell {
    fn add(&mut self, light: Vec3, clipped: bool) {
        self.light += light;
        self.clipped += f32::from(u8::from(clipped));
        self.pixels += 1.0;
    }

    fn plus(&self, other: &Self, weight: f32) -> Self {
        Self {
            light: self.light + other.light * weight,
            clipped: self.clipped + other.clipped * weight,
            pixels: self.pixels + other.pixels * weight,
        }
    }
}

/// Halves width and height, rounded up; each pixel is the mean of the up to four pixels that it covers.
fn halved(image: &RadianceImage) -> RadianceImage {
    let (width, height) = (image.width().div_ceil(2), image.height().div_ceil(2));
    let last = (image.width() - 1, image.height() - 1);
    let rows: Vec<Vec<[f32; 3]>> = (0..height)
        .into_par_iter()
        .map(|y| {
            let pixel = |x: usize| {
                let corners = [(0, 0), (1, 0), (0, 1), (1, 1)];
                let sum = corners.map(|(i, j)| image[((2 * x + i).min(last.0), (2 * y + j).min(last.1))]);
                (sum.into_iter().map(Vec3::from).sum::<Vec3>() / 4.0).to_array()
            };
            (0..width).map(pixel).collect()
        })
        .collect();
    Image::new(width, height, rows.into_iter().flatten().collect())
}

/// Interpolates between the four pixels around a position; pixel centres are at +0.5, and border pixels are repeated
/// outside.
pub(crate) fn bilinear(image: &RadianceImage, at: Vec2) -> Vec3 {
    let last = Vec2::new((image.width() - 1) as f32, (image.height() - 1) as f32);
    let at = (at - 0.5).min(last).max(Vec2::ZERO);
    let (x, y) = (at.x as usize, at.y as usize);
    let (x1, y1) = ((x + 1).min(image.width() - 1), (y + 1).min(image.height() - 1));
    let (fx, fy) = (at.x - x as f32, at.y - y as f32);
    let row = |y: usize| Vec3::from(image[(x, y)]).lerp(Vec3::from(image[(x1, y)]), fx);
    row(y).lerp(row(y1), fy)
}
