//! Edges of sun patches: positions where one surface changes from bright to dark within a few pixels.

use lo_geometry::Vec3;
use lo_imaging::{Image, RadianceImage, luminance};
use lo_scene::Frame;

/// Distance in pixels from the centre of an edge to the samples on either side.
const STEP: isize = 3;

/// Distance in pixels up to which either side is uniform.
const WIDE: isize = 8;

/// Least difference of log luminance across an edge.
const MIN_CONTRAST: f32 = 0.7;

/// Greatest drift of log luminance on either side, as a share of the contrast.
const MAX_DRIFT: f32 = 0.5;

/// Least brightness of the lit side, in units of the photo's white: cameras expose for the room.
const MIN_LIT: f32 = 0.25;

/// Luminance below which differences are noise.
const DARK: f32 = 2e-3;

/// Flatness of an edge: greatest deviation of both sides from one plane, as a share of depth, and least cosine between
/// their normals.
const FLATNESS: f32 = 0.02;
const MIN_ALIKE: f32 = 0.93;

/// Least cosine at which sunlight creates an edge.
const MIN_COSINE: f32 = 0.08;

/// The two sides of an edge.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Edge {
    pub lit: EdgeSide,
    pub shaded: EdgeSide,
}

/// A surface point on one side of an edge.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct EdgeSide {
    pub pixel: (usize, usize),
    pub position_m: Vec3,
    /// Unit normal, towards the camera.
    pub normal: Vec3,
}

/// Returns the logarithm of a photo's luminance.
pub(super) fn log_luminance(radiance: &RadianceImage) -> Image<f32> {
    radiance.map(|&rgb| luminance(rgb).max(DARK).ln())
}

/// Finds edges on surfaces that face the sun, in a frame whose photo and depth have the same resolution.
pub(super) fn edges(frame: &Frame, log: &Image<f32>, normals: &Image<Option<Vec3>>, sun: Vec3) -> Vec<Edge> {
    let (width, height) = (log.width(), log.height());
    let border = WIDE as usize + 1;
    let strongest = |x: usize, y: usize| {
        [(1, 0), (0, 1), (1, 1), (1, -1)]
            .into_iter()
            .filter_map(|direction| edge(frame, log, normals, (x, y), direction))
            .max_by(|a, b| a.0.total_cmp(&b.0))
    };
    let pixels = (border..height.saturating_sub(border))
        .flat_map(|y| (border..width.saturating_sub(border)).map(move |x| (x, y)));
    let found = pixels.filter_map(|(x, y)| strongest(x, y).map(|(_, edge)| edge));
    found.filter(|edge| edge.lit.normal.dot(sun) > MIN_COSINE).collect()
}

/// Returns the edge across a pixel in one direction, with its contrast.
fn edge(
    frame: &Frame,
    log: &Image<f32>,
    normals: &Image<Option<Vec3>>,
    (x, y): (usize, usize),
    (dx, dy): (isize, isize),
) -> Option<(f32, Edge)> {
    let pixel = |step: isize| (x.wrapping_add_signed(dx * step), y.wrapping_add_signed(dy * step));
    let at = |step: isize| log[pixel(step)];
    let difference = at(-STEP) - at(STEP);
    let contrast = difference.abs();
    if contrast < MIN_CONTRAST || at(-STEP).max(at(STEP)) < (MIN_LIT * frame.exposure).ln() {
        return None;
    }
    // Only the steepest pixel of an edge.
    let slope = |step: isize| (at(step - 1) - at(step + 1)).abs();
    if slope(0) < slope(1).max(slope(-1)) {
        return None;
    }
    let drift = (at(-WIDE) - at(-STEP)).abs().max((at(STEP) - at(WIDE)).abs());
    if drift > MAX_DRIFT * contrast {
        return None;
    }
    let side = |step: isize| {
        let pixel = pixel(step);
        Some(EdgeSide { pixel, position_m: frame.point(pixel.0, pixel.1)?, normal: normals[pixel]? })
    };
    let bright = if difference > 0.0 { -STEP } else { STEP };
    let (lit, shaded) = (side(bright)?, side(-bright)?);
    let offset = shaded.position_m - lit.position_m;
    let flat = |normal: Vec3| offset.dot(normal).abs() < -FLATNESS * lit.position_m.z;
    let even = lit.normal.dot(shaded.normal) > MIN_ALIKE && flat(lit.normal) && flat(shaded.normal);
    even.then_some((contrast, Edge { lit, shaded }))
}
