//! Labelling of all pixels as lit or shaded, from the edges of sun patches.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use lo_imaging::Image;
use lo_scene::Frame;

use super::edges::Edge;

/// Costs of a step between adjacent pixels: constant, per e-fold of luminance, and per relative change of depth.
const STEP: f32 = 0.01;
const BY_LUMINANCE: f32 = 1.0;
const BY_DEPTH: f32 = 20.0;

/// Greatest cost up to which an edge labels pixels.
const REACH: f32 = 4.0;

/// Returns whether each pixel is brighter than the mid-level of its nearest edge, along paths on which luminance and
/// depth change little.
pub(super) fn label(frame: &Frame, log: &Image<f32>, edges: &[Edge]) -> Image<bool> {
    let (width, height) = (log.width(), log.height());
    let mut lit = Image::new(width, height, vec![false; width * height]);
    let mut costs = Image::new(width, height, vec![REACH; width * height]);
    // Costs are not negative, so their bits sort as they do.
    let mut next = BinaryHeap::new();
    let middles: Vec<f32> = edges.iter().map(|edge| 0.5 * (log[edge.lit.pixel] + log[edge.shaded.pixel])).collect();
    for (index, edge) in edges.iter().enumerate() {
        next.extend([edge.lit, edge.shaded].map(|side| Reverse((0u32, side.pixel, index))));
    }
    while let Some(Reverse((bits, (x, y), index))) = next.pop() {
        let cost = f32::from_bits(bits);
        if cost >= costs[(x, y)] {
            continue;
        }
        costs[(x, y)] = cost;
        lit[(x, y)] = log[(x, y)] > middles[index];
        let depth_m = frame.depth_m[(x, y)];
        for (dx, dy) in [(-1, 0), (1, 0), (0, -1), (0, 1)] {
            let (Some(px), Some(py)) = (x.checked_add_signed(dx), y.checked_add_signed(dy)) else { continue };
            if px >= width || py >= height {
                continue;
            }
            let other_m = frame.depth_m[(px, py)];
            if other_m <= 0.0 {
                continue;
            }
            let depth_step = (other_m - depth_m).abs() / other_m.min(depth_m).max(1e-3);
            let step = STEP + BY_LUMINANCE * (log[(px, py)] - log[(x, y)]).abs() + BY_DEPTH * depth_step;
            if cost + step < costs[(px, py)] {
                next.push(Reverse(((cost + step).to_bits(), (px, py), index)));
            }
        }
    }
    lit
}
