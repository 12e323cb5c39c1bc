//! Samples of observed surfaces whose shading is compared: cells of segments of assumed constant albedo.

use lo_geometry::Vec3;
use lo_imaging::{Image, RadianceImage, luminance};
use lo_scene::Frame;

/// Cells along the longer side of the photo.
const CELLS: usize = 96;

/// Share of a cell's pixels that must have depth.
const MIN_FILLED: f32 = 0.6;

/// Greatest differences of adjacent cells with one albedo, in log luminance and in the logarithm of a channel's ratio.
const MAX_STEP: f32 = 0.14;
const MAX_COLOUR_STEP: f32 = 0.05;

/// Greatest relative difference of the inverse depths of adjacent cells on one surface.
const MAX_DEPTH_STEP: f32 = 0.08;

/// Least number of cells of a segment.
const MIN_CELLS: usize = 6;

/// Greatest number of samples.
const MAX_SAMPLES: usize = 900;

/// Luminance below which noise hides shading.
const MIN_LUMINANCE: f32 = 2e-3;

/// Standard deviation of log luminance within a cell (texture, edges) at which its weight is halved.
const TEXTURE: f32 = 0.25;

/// Ratio of restored to clipped luminance above which a pixel belongs to a lamp or a window.
const SHINES: f32 = 1.2;

/// A piece of an observed surface, of the size of a cell of the photo.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct ShadingSample {
    pub position_m: Vec3,
    /// Unit normal, towards the camera.
    pub normal: Vec3,
    /// Mean log luminance.
    pub log_radiance: f32,
    /// Whether most of its pixels are clipped.
    pub clipped: bool,
    /// Weight.
    pub weight: f32,
    /// Index of the segment; cells of one segment have one albedo.
    pub segment: usize,
}

struct Cell {
    position_m: Vec3,
    normal: Vec3,
    log_radiance: f32,
    /// Logarithms of red and blue over green.
    colour: [f32; 2],
    clipped: bool,
    deviation: f32,
    inverse_depth: f32,
}

/// Samples a frame whose photo and depth have the same resolution ([`Frame::working`]); returns at most [`MAX_SAMPLES`]
/// samples. Pixels that are brighter in `restored` than in the photo emit light and are skipped.
pub(crate) fn shading_samples(
    frame: &Frame,
    normals: &Image<Option<Vec3>>,
    restored: &RadianceImage,
) -> Vec<ShadingSample> {
    let (width, height) = (frame.depth_m.width(), frame.depth_m.height());
    let (radiance, clipped) = (frame.radiance(), frame.clipped());
    if (radiance.width(), radiance.height()) != (width, height) {
        return Vec::new();
    }
    let edge = (width.max(height) / CELLS).max(1);
    let (columns, rows) = (width / edge, height / edge);
    let cell = |column: usize, row: usize| -> Option<Cell> {
        let pixels =
            (row * edge..(row + 1) * edge).flat_map(|y| (column * edge..(column + 1) * edge).map(move |x| (x, y)));
        let (mut count, mut sums, mut squares) = (0.0f32, [0.0f32; 4], 0.0f32);
        let (mut normal, mut position_m, mut cut) = (Vec3::ZERO, Vec3::ZERO, 0.0f32);
        for (x, y) in pixels {
            let (Some(point), Some(own)) = (frame.point(x, y), normals[(x, y)]) else { continue };
            if luminance(restored[(x, y)]) > SHINES * luminance(radiance[(x, y)]) {
                continue;
            }
            let rgb = radiance[(x, y)].map(|v| v.max(1e-4));
            let log = luminance(rgb).max(MIN_LUMINANCE).ln();
            count += 1.0;
            squares += log * log;
            let values = [log, (rgb[0] / rgb[1]).ln(), (rgb[2] / rgb[1]).ln(), 1.0 / -point.z];
            sums.iter_mut().zip(values).for_each(|(sum, value)| *sum += value);
            normal += own;
            position_m += point;
            cut += f32::from(u8::from(clipped[(x, y)]));
        }
        if count < MIN_FILLED * (edge * edge) as f32 {
            return None;
        }
        let [log_radiance, red, blue, inverse_depth] = sums.map(|sum| sum / count);
        Some(Cell {
            position_m: position_m / count,
            normal: normal.try_normalize()?,
            log_radiance,
            colour: [red, blue],
            clipped: cut > 0.5 * count,
            deviation: (squares / count - log_radiance * log_radiance).max(0.0).sqrt(),
            inverse_depth,
        })
    };
    let cells: Vec<Option<Cell>> = (0..columns * rows).map(|i| cell(i % columns, i / columns)).collect();

    let mut parents: Vec<usize> = (0..cells.len()).collect();
    for i in 0..cells.len() {
        let right = (i % columns + 1 < columns).then_some(i + 1);
        let below = (i + columns < cells.len()).then_some(i + columns);
        for other in [right, below].into_iter().flatten() {
            if let (Some(a), Some(b)) = (&cells[i], &cells[other])
                && are_alike(a, b)
            {
                let (a, b) = (root(&mut parents, i), root(&mut parents, other));
                parents[a.max(b)] = a.min(b);
            }
        }
    }
    let roots: Vec<usize> = (0..cells.len()).map(|i| root(&mut parents, i)).collect();
    let mut sizes = vec![0usize; cells.len()];
    roots.iter().zip(&cells).filter(|(_, cell)| cell.is_some()).for_each(|(&root, _)| sizes[root] += 1);
    let mut numbers = vec![usize::MAX; cells.len()];
    let mut segments = 0;
    let mut samples = Vec::new();
    for (cell, &root) in cells.iter().zip(&roots) {
        let Some(cell) = cell.as_ref().filter(|_| sizes[root] >= MIN_CELLS) else { continue };
        if numbers[root] == usize::MAX {
            numbers[root] = segments;
            segments += 1;
        }
        samples.push(ShadingSample {
            position_m: cell.position_m,
            normal: cell.normal,
            log_radiance: cell.log_radiance,
            clipped: cell.clipped,
            weight: 1.0 / (1.0 + (cell.deviation / TEXTURE).powi(2)),
            segment: numbers[root],
        });
    }
    let stride = samples.len().div_ceil(MAX_SAMPLES).max(1);
    let weight = stride as f32;
    samples
        .into_iter()
        .skip(stride / 2)
        .step_by(stride)
        .map(|sample| ShadingSample { weight: sample.weight * weight, ..sample })
        .collect()
}

fn are_alike(a: &Cell, b: &Cell) -> bool {
    let near = (a.inverse_depth - b.inverse_depth).abs() < MAX_DEPTH_STEP * a.inverse_depth.min(b.inverse_depth);
    // Cells that are both clipped belong together, since nothing else is known about them.
    let bright = (a.log_radiance - b.log_radiance).abs() < MAX_STEP;
    let colour = a.colour.iter().zip(b.colour).all(|(a, b)| (a - b).abs() < MAX_COLOUR_STEP);
    near && bright && (colour || (a.clipped && b.clipped)) && a.clipped == b.clipped
}

fn root(parents: &mut [usize], mut i: usize) -> usize {
    while parents[i] != i {
        parents[i] = parents[parents[i]];
        i = parents[i];
    }
    i
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use lo_geometry::Camera;
    use lo_imaging::{DepthMap, Photo, RadianceImage};

    use super::*;

    #[test]
    fn albedo_edges_and_depth_edges_part_segments_and_shading_does_not() {
        let camera = Camera::from_hfov_deg(60.0, 480, 320).unwrap();
        // A wall whose light falls off to the right; its lower half is darker paint, and a board is in front of its
        // right third.
        let photo = RadianceImage::from_fn(480, 320, |x, y| {
            let light = 0.8 - 0.6 * x as f32 / 480.0;
            [if y < 160 { light } else { 0.4 * light }; 3]
        });
        let depth_m = DepthMap::from_fn(480, 320, |x, _| if x < 320 { 3.0 } else { 2.0 });
        let frame = Frame::new(Photo::Linear(photo), depth_m, camera, 1.0).unwrap();
        let samples = shading_samples(&frame, &frame.normals(), &frame.radiance());
        assert!((400..=MAX_SAMPLES).contains(&samples.len()), "{}", samples.len());
        let mut segments: Vec<usize> = samples.iter().map(|sample| sample.segment).collect();
        segments.sort_unstable();
        segments.dedup();
        assert_eq!(segments.len(), 4);
        for sample in &samples {
            let alike = samples.iter().filter(|other| other.segment == sample.segment);
            let up = |p: &ShadingSample| p.position_m.y > 0.0;
            assert!(
                alike
                    .clone()
                    .all(|other| up(other) == up(sample) && (other.position_m.z - sample.position_m.z).abs() < 0.1)
            );
            assert!(sample.normal.z > 0.99 && !sample.clipped);
        }
        let total: f32 = samples.iter().map(|sample| sample.weight).sum();
        assert!((total / (96.0 * 64.0) - 1.0).abs() < 0.1, "{total}");
    }

    #[test]
    fn without_depth_there_are_no_samples() {
        let camera = Camera::from_hfov_deg(60.0, 48, 32).unwrap();
        let photo = RadianceImage::from_fn(48, 32, |_, _| [0.5; 3]);
        let frame = Frame {
            camera,
            photo: Photo::Linear(photo),
            depth_m: DepthMap::from_fn(48, 32, |_, _| 0.0),
            exposure: 1.0,
        };
        assert_eq!(shading_samples(&frame, &frame.normals(), &frame.radiance()), Vec::new());
    }
}
