//! Depth edges.

use lo_imaging::Image;

/// Relative difference of inverse depth between adjacent pixels above which they may be on both sides of a depth edge.
/// The difference must also deviate from a plane.
const EDGE: f32 = 0.04;

/// Finds depth edges in an image of inverse depth.
///
/// Returns whether a depth edge runs between a pixel and those right of it, below it, and diagonally below; and how far
/// inverse depth deviates from its neighbours' plane (maximum over 3 × 3 pixels).
pub(crate) fn edges(inverse: &Image<f32>) -> (Image<bool>, Image<f32>) {
    let (width, height) = (inverse.width(), inverse.height());
    let bent = Image::from_fn(width, height, |x, y| {
        let bend = |a: f32, b: f32| (a + b - 2.0 * inverse[(x, y)]).abs();
        let along = if x > 0 && x + 1 < width { bend(inverse[(x - 1, y)], inverse[(x + 1, y)]) } else { 0.0 };
        let down = if y > 0 && y + 1 < height { bend(inverse[(x, y - 1)], inverse[(x, y + 1)]) } else { 0.0 };
        along.max(down)
    });
    let edge = Image::from_fn(width, height, |x, y| {
        let around = [x, (x + 1).min(width - 1)].map(|x| [y, (y + 1).min(height - 1)].map(|y| (x, y)));
        let around = around.as_flattened().iter();
        let (low, high, bend) = around.fold((f32::INFINITY, 0.0f32, 0.0f32), |(low, high, bend), &at| {
            (low.min(inverse[at]), high.max(inverse[at]), bend.max(bent[at]))
        });
        // On a plane seen at a grazing angle inverse depth falls off as steeply, but does not bend.
        high - low > EDGE * high && bend > 0.5 * (high - low)
    });
    let jump = Image::from_fn(width, height, |x, y| {
        let rows = y.saturating_sub(1)..height.min(y + 2);
        let around = rows.flat_map(|y| (x.saturating_sub(1)..width.min(x + 2)).map(move |x| (x, y)));
        around.map(|at| bent[at]).fold(0.0, f32::max)
    });
    (edge, jump)
}
