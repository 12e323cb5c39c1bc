//! Photo and depth at another resolution.

use imaging::{DepthMap, Image, Photo, RadianceImage};
use rayon::prelude::*;

/// Readings whose depths differ by less than this share belong to one surface.
const SAME_SURFACE: f32 = 0.05;

/// Linear values of the 256 sRGB codes (IEC 61966-2-1).
pub(crate) fn linear_from_srgb8() -> [f32; 256] {
    std::array::from_fn(|code| {
        let c = code as f64 / 255.0;
        (if c <= 0.04045 { c / 12.92 } else { ((c + 0.055) / 1.055).powf(2.4) }) as f32
    })
}

/// Mean linear value over each new pixel's footprint (box filter with exact edge weights).
///
/// 8-bit photos are converted row by row, so that a 50-megapixel photo never exists as 600 MB of floats.
pub(crate) fn photo(photo: &Photo, width: usize, height: usize) -> RadianceImage {
    let linear = linear_from_srgb8();
    match photo {
        Photo::Srgb8(image) => boxed(image, width, height, |p| p.map(|c| linear[usize::from(c)])),
        Photo::Linear(image) => {
            boxed(image, width, height, |p| p.map(|c| if c.is_finite() { c.max(0.0) } else { 0.0 }))
        }
    }
}

fn boxed<T: Copy + Sync>(
    image: &Image<T>,
    width: usize,
    height: usize,
    linear: impl Fn(T) -> [f32; 3] + Sync,
) -> RadianceImage {
    let columns: Vec<Footprint> = (0..width).map(|x| Footprint::new(x, width, image.width())).collect();
    let rows: Vec<Vec<[f32; 3]>> = (0..height)
        .into_par_iter()
        .map(|y| {
            let footprint = Footprint::new(y, height, image.height());
            let mut sums = vec![[0.0f32; 3]; image.width()];
            for (row, weight) in footprint.weights() {
                let line = &image.pixels()[row * image.width()..(row + 1) * image.width()];
                for (sum, &pixel) in sums.iter_mut().zip(line) {
                    let value = linear(pixel);
                    for c in 0..3 {
                        sum[c] += weight * value[c];
                    }
                }
            }
            let mean = |column: &Footprint| {
                let mut total = [0.0; 3];
                for (x, weight) in column.weights() {
                    for c in 0..3 {
                        total[c] += weight * sums[x][c];
                    }
                }
                total
            };
            columns.iter().map(mean).collect()
        })
        .collect();
    Image::new(width, height, rows.into_iter().flatten().collect())
}

/// The source pixels that a new pixel covers, along one axis.
struct Footprint {
    start: f64,
    end: f64,
    last: usize,
}

impl Footprint {
    fn new(index: usize, count: usize, source: usize) -> Self {
        let scale = source as f64 / count as f64;
        Self { start: index as f64 * scale, end: (index + 1) as f64 * scale, last: source - 1 }
    }

    /// Source indices with weights that sum to 1.
    fn weights(&self) -> impl Iterator<Item = (usize, f32)> {
        let (start, end, last) = (self.start, self.end, self.last);
        (start as usize..=(end.ceil() as usize).saturating_sub(1).clamp(start as usize, last)).map(move |i| {
            let overlap = end.min((i + 1) as f64) - start.max(i as f64);
            (i, (overlap / (end - start)) as f32)
        })
    }
}

/// Depth at another resolution; surfaces are not mixed and holes stay holes.
pub(crate) fn depth(depth_m: &DepthMap, width: usize, height: usize) -> DepthMap {
    let (w, h) = (depth_m.width(), depth_m.height());
    if (w, h) == (width, height) {
        return depth_m.clone();
    }
    let (sx, sy) = (w as f64 / width as f64, h as f64 / height as f64);
    let rows: Vec<Vec<f32>> = (0..height)
        .into_par_iter()
        .map(|y| {
            let mut window = Vec::new();
            let v = (y as f64 + 0.5) * sy;
            (0..width)
                .map(|x| {
                    let u = (x as f64 + 0.5) * sx;
                    if sx > 1.0 || sy > 1.0 {
                        median_reading(depth_m, (u, v), (sx, sy), &mut window)
                    } else {
                        interpolated(depth_m, u, v)
                    }
                })
                .collect()
        })
        .collect();
    Image::new(width, height, rows.into_iter().flatten().collect())
}

/// The middle reading of the footprint around `(u, v)`: always one that was measured; a hole where most are holes.
fn median_reading(depth_m: &DepthMap, (u, v): (f64, f64), (sx, sy): (f64, f64), window: &mut Vec<f32>) -> f32 {
    // Pixels whose centres lie in the footprint; the nearest one where it is smaller than a pixel along this axis.
    let range = |centre: f64, size: f64, count: usize| {
        let start = ((centre - 0.5 * size.max(1.0) + 0.5).floor().max(0.0) as usize).min(count - 1);
        let end = ((centre + 0.5 * size.max(1.0) + 0.5).floor() as usize).clamp(start + 1, count);
        start..end
    };
    window.clear();
    let columns = range(u, sx, depth_m.width());
    let rows = range(v, sy, depth_m.height());
    let covered = columns.len() * rows.len();
    for y in rows {
        window.extend(columns.clone().map(|x| depth_m[(x, y)]).filter(|&z| z > 0.0));
    }
    if 2 * window.len() < covered.max(1) || window.is_empty() {
        return 0.0;
    }
    let middle = (window.len() - 1) / 2;
    *window.select_nth_unstable_by(middle, f32::total_cmp).1
}

/// Bilinear in inverse depth (exact on planes) between those of the four nearest readings that lie on the nearest one's surface.
fn interpolated(depth_m: &DepthMap, u: f64, v: f64) -> f32 {
    let (u, v) = (u - 0.5, v - 0.5);
    let clamped = |value: f64, count: usize| value.clamp(0.0, (count - 1) as f64) as usize;
    let nearest = depth_m[(clamped(u.round(), depth_m.width()), clamped(v.round(), depth_m.height()))];
    if nearest <= 0.0 {
        return 0.0;
    }
    let (fu, fv) = ((u - u.floor()) as f32, (v - v.floor()) as f32);
    let (mut sum, mut weights) = (0.0, 0.0);
    for (dx, wx) in [(0.0, 1.0 - fu), (1.0, fu)] {
        for (dy, wy) in [(0.0, 1.0 - fv), (1.0, fv)] {
            let z = depth_m[(clamped(u.floor() + dx, depth_m.width()), clamped(v.floor() + dy, depth_m.height()))];
            if z > 0.0 && (z - nearest).abs() < SAME_SURFACE * z.min(nearest) {
                sum += wx * wy / z;
                weights += wx * wy;
            }
        }
    }
    if sum > 0.0 { weights / sum } else { nearest }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn means_are_kept_and_edges_are_not_mixed() {
        let photo_in = Photo::Linear(Image::from_fn(7, 5, |x, y| [x as f32, y as f32, 1.0]));
        let small = photo(&photo_in, 3, 2);
        let mean = |image: &RadianceImage, c: usize| {
            image.pixels().iter().map(|p| p[c]).sum::<f32>() / image.pixels().len() as f32
        };
        for (c, expected) in [(0, 3.0), (1, 2.0), (2, 1.0)] {
            assert!((mean(&small, c) - expected).abs() < 1e-5);
        }
        let step = Image::from_fn(8, 8, |x, _| if x < 3 { 1.0 } else { 4.0 });
        for (w, h) in [(5, 5), (3, 8), (21, 16), (1, 1)] {
            assert!(depth(&step, w, h).pixels().iter().all(|&z| z == 1.0 || z == 4.0), "{w} × {h}");
        }
    }

    #[test]
    fn holes_stay_holes() {
        let holes = Image::from_fn(8, 8, |x, _| if x < 4 { 0.0 } else { 2.0 });
        for (w, h) in [(4, 4), (16, 16), (8, 4)] {
            let resized = depth(&holes, w, h);
            let share = resized.pixels().iter().filter(|&&z| z == 0.0).count() as f32 / (w * h) as f32;
            assert_eq!(share, 0.5, "{w} × {h}");
        }
    }
}
