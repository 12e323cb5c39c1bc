//! Resizing of photos and depth maps.

use rayon::prelude::*;

use crate::{DepthMap, Image, RadianceImage};

/// Largest relative difference of depth between neighbouring samples of one surface.
const SAME_SURFACE: f32 = 0.05;

/// Resizes an image: each new pixel is the mean over its footprint (a box filter with exact edge weights). An enlarged
/// axis is interpolated linearly.
///
/// # Panics
/// If either size has no pixels.
pub fn resize(image: &RadianceImage, width: usize, height: usize) -> RadianceImage {
    assert!(!image.pixels().is_empty() && width > 0 && height > 0, "an image without pixels cannot be resized");
    let clamp = |index: i64, count: i64| index.clamp(0, count - 1);
    weighted(image, &weights(image.width(), width, |e| e, clamp), &weights(image.height(), height, |e| e, clamp))
}

/// Returns, for each new index of an axis, the old indices with weights that sum to 1.
///
/// `measure` is the axis' measure from its start to an edge in `[0, 1]`; `wrap` maps neighbours beyond the ends back.
pub(crate) fn weights(
    old: usize,
    new: usize,
    measure: impl Fn(f64) -> f64,
    wrap: impl Fn(i64, i64) -> i64,
) -> Vec<Vec<(usize, f64)>> {
    let interpolated = |index: usize| {
        let position = (index as f64 + 0.5) * old as f64 / new as f64 - 0.5;
        let (first, share) = (position.floor() as i64, position - position.floor());
        let old = old as i64;
        vec![(wrap(first, old) as usize, 1.0 - share), (wrap(first + 1, old) as usize, share)]
    };
    let covered = |index: usize| {
        let edge = |i: usize| measure(i as f64 / new as f64);
        let (start, end) = (edge(index), edge(index + 1));
        let first = index * old / new;
        let last = ((index + 1) * old).div_ceil(new).min(old);
        let overlap = |i: usize| {
            let (a, b) = (measure(i as f64 / old as f64), measure((i + 1) as f64 / old as f64));
            (i, ((b.min(end) - a.max(start)) / (end - start)).max(0.0))
        };
        (first..last).map(overlap).collect()
    };
    (0..new).map(|index| if new > old { interpolated(index) } else { covered(index) }).collect()
}

/// Sums rows, then columns, by their weights, in f64.
pub(crate) fn weighted(
    image: &RadianceImage,
    columns: &[Vec<(usize, f64)>],
    rows: &[Vec<(usize, f64)>],
) -> RadianceImage {
    let pixels = rows
        .par_iter()
        .flat_map_iter(|row| {
            let mut line = vec![[0.0f64; 3]; image.width()];
            for &(y, weight) in row {
                let source = &image.pixels()[y * image.width()..][..image.width()];
                for (sum, value) in line.as_flattened_mut().iter_mut().zip(source.as_flattened()) {
                    *sum += weight * f64::from(*value);
                }
            }
            columns.iter().map(move |column| {
                [0, 1, 2].map(|c| column.iter().map(|&(x, weight)| weight * line[x][c]).sum::<f64>() as f32)
            })
        })
        .collect();
    RadianceImage::new(columns.len(), rows.len(), pixels)
}

/// Resizes depth without mixing surfaces; holes stay holes.
///
/// * Enlarging: bilinear if the four neighbours are readings within 5 %, else the nearest sample (which may be a hole).
/// * Shrinking: the median of the largest group of readings under the new pixel without a step of 5 %, the nearer one
///   of equals. A hole if more than half of the samples are holes. The largest group, not the foremost, keeps outlines
///   in place.
///
/// # Panics
/// If either size has no pixels.
pub fn resize_depth(depth_m: &DepthMap, width: usize, height: usize) -> DepthMap {
    assert!(!depth_m.pixels().is_empty() && width > 0 && height > 0, "a map without pixels cannot be resized");
    if (width, height) == (depth_m.width(), depth_m.height()) {
        return depth_m.clone();
    }
    let (sx, sy) = (depth_m.width() as f64 / width as f64, depth_m.height() as f64 / height as f64);
    let pixel = |index: usize| {
        let (x, y) = (index % width, index / width);
        if sx > 1.0 || sy > 1.0 {
            // samples whose centres are under the pixel; at least the one at its centre
            let span = |i: usize, scale: f64, count: usize| {
                let (start, end) = (i as f64 * scale, (i + 1) as f64 * scale);
                let (first, last) = ((start + 0.5).floor() as usize, (end + 0.5).floor() as usize);
                if first < last { first..last.min(count) } else { middle(start, end, count) }
            };
            main_surface(depth_m, span(x, sx, depth_m.width()), span(y, sy, depth_m.height()))
        } else {
            interpolate(depth_m, (x as f64 + 0.5) * sx - 0.5, (y as f64 + 0.5) * sy - 0.5)
        }
    };
    Image::new(width, height, (0..width * height).into_par_iter().map(pixel).collect())
}

fn middle(start: f64, end: f64, count: usize) -> std::ops::Range<usize> {
    let index = ((0.5 * (start + end)) as usize).min(count - 1);
    index..index + 1
}

/// Returns the median of the largest group of readings in a rectangle of samples; 0 if most are holes.
fn main_surface(depth_m: &DepthMap, columns: std::ops::Range<usize>, rows: std::ops::Range<usize>) -> f32 {
    let samples = columns.len() * rows.len();
    let mut readings: Vec<f32> =
        rows.flat_map(|y| columns.clone().map(move |x| depth_m[(x, y)])).filter(|&d| d > 0.0).collect();
    if 2 * readings.len() < samples || readings.is_empty() {
        return 0.0;
    }
    readings.sort_by(f32::total_cmp);
    let mut largest: &[f32] = &[];
    for group in readings.chunk_by(|a, b| *b <= *a * (1.0 + SAME_SURFACE)) {
        if group.len() > largest.len() {
            largest = group;
        }
    }
    largest[(largest.len() - 1) / 2]
}

/// Interpolates bilinearly between samples of one surface at sample position `(x, y)`, else takes the nearest sample.
fn interpolate(depth_m: &DepthMap, x: f64, y: f64) -> f32 {
    let axis = |position: f64, count: usize| {
        let position = position.clamp(0.0, (count - 1) as f64);
        let first = position as usize;
        (first, (first + 1).min(count - 1), (position - first as f64) as f32)
    };
    let (x0, x1, fx) = axis(x, depth_m.width());
    let (y0, y1, fy) = axis(y, depth_m.height());
    let [a, b, c, d] = [(x0, y0), (x1, y0), (x0, y1), (x1, y1)].map(|at| depth_m[at]);
    let (near, far) = (a.min(b).min(c).min(d), a.max(b).max(c).max(d));
    if near > 0.0 && far <= near * (1.0 + SAME_SURFACE) {
        let mix = |a: f32, b: f32, t: f32| a + (b - a) * t;
        return mix(mix(a, b, fx), mix(c, d, fx), fy);
    }
    depth_m[(if fx < 0.5 { x0 } else { x1 }, if fy < 0.5 { y0 } else { y1 })]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_box_keeps_the_mean() {
        let image = RadianceImage::from_fn(90, 60, |x, y| [((x * 7 + y * 13) % 29) as f32, x as f32, 1.0]);
        let mean = |image: &RadianceImage, c: usize| {
            image.pixels().iter().map(|p| f64::from(p[c])).sum::<f64>() / image.pixels().len() as f64
        };
        for (width, height) in [(45, 30), (31, 17), (1, 1), (90, 60)] {
            let small = resize(&image, width, height);
            for c in 0..3 {
                assert!((mean(&small, c) / mean(&image, c) - 1.0).abs() < 1e-5, "{width} × {height}");
            }
        }
        // three columns into two: each takes one and a half
        let row = RadianceImage::new(3, 1, vec![[3.0; 3], [6.0; 3], [0.0; 3]]);
        let two = resize(&row, 2, 1);
        assert!((two[(0, 0)][0] - 4.0).abs() < 1e-6 && (two[(1, 0)][0] - 2.0).abs() < 1e-6);
        // enlarging interpolates and clamps at the borders
        let four: Vec<f32> =
            resize(&RadianceImage::new(2, 1, vec![[0.0; 3], [4.0; 3]]), 4, 1).pixels().iter().map(|p| p[0]).collect();
        assert_eq!(four, [0.0, 1.0, 3.0, 4.0]);
    }

    #[test]
    fn depth_is_never_mixed_across_an_edge() {
        // a slowly receding plane in front of a far wall, with a hole
        let depth = DepthMap::from_fn(40, 30, |x, y| match (x, y) {
            (5..8, 5..8) => 0.0,
            (0..20, _) => 1.0 + x as f32 * 0.01,
            _ => 4.0,
        });
        for (width, height) in [(160, 120), (61, 47), (20, 15), (13, 11), (7, 60), (1, 1)] {
            let resized = resize_depth(&depth, width, height);
            assert_eq!((resized.width(), resized.height()), (width, height));
            for &d in resized.pixels() {
                assert!(d == 0.0 || (1.0..=1.19001).contains(&d) || d == 4.0, "{width} × {height}: {d}");
            }
        }
        let large = resize_depth(&depth, 160, 120);
        let holes = large.pixels().iter().filter(|&&d| d == 0.0).count();
        assert_eq!(holes, 9 * 16, "a hole keeps its area");
        // interpolated on the plane: pixel 41 of 160 lies at sample 9.875
        assert!((large[(41, 100)] - 1.09875).abs() < 1e-5);
        assert_eq!(resize_depth(&depth, 40, 30), depth);
    }

    #[test]
    fn shrinking_takes_the_larger_surface_and_keeps_large_holes() {
        let depth = DepthMap::new(4, 2, vec![1.0, 3.0, 0.0, 0.0, 3.0, 3.1, 0.0, 2.0]);
        assert_eq!(resize_depth(&depth, 2, 1).pixels(), [3.0, 0.0]);
        // the nearer of equal groups
        assert_eq!(resize_depth(&DepthMap::new(2, 1, vec![2.0, 1.0]), 1, 1).pixels(), [1.0]);
    }
}
