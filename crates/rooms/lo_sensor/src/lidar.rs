//! Phone LiDAR: depth fused from a few hundred laser dots. Low resolution, smooth, without holes.

use lo_imaging::{DepthMap, Image};
use lo_random::{RngExt, Stream};
use rand_distr::{Distribution, StandardNormal};

use crate::depth_view::DepthView;
use crate::interval::Interval;

/// Width of a phone's LiDAR map, in pixels.
const LIDAR_WIDTH: usize = 256;

/// Simulates a phone's fused LiDAR map.
pub(crate) fn lidar(view: &DepthView, range_m: f32, noise: f32, blur_px: f32, stream: &mut Stream) -> DepthMap {
    let (width, height) = (view.depth_m.width(), view.depth_m.height());
    let measured =
        Image::from_fn(width, height, |x, y| view.returned(x, y).is_some() && view.depth_m[(x, y)] <= range_m);
    let low = LIDAR_WIDTH.min(width);
    let low_height = ((low * height) as f32 / width as f32).round().max(1.0) as usize;
    let smooth = fuse(view.depth_m, &measured, low, low_height, blur_px);
    // Errors of the fusion are smooth too: a scale error, and waves over tens of pixels.
    let scale = 1.0 + 0.005 * noise * normal(stream);
    let waves: Vec<[f32; 4]> = (0..6)
        .map(|_| {
            let period = Interval::new(12.0, 60.0).draw_log(stream);
            let direction = std::f32::consts::TAU * stream.random::<f32>();
            let wave_number = std::f32::consts::TAU / period;
            let phase = std::f32::consts::TAU * stream.random::<f32>();
            [wave_number * direction.cos(), wave_number * direction.sin(), phase, 0.002 * noise * normal(stream)]
        })
        .collect();
    Image::from_fn(low, low_height, |x, y| {
        let z = smooth[(x, y)];
        let ripple: f32 =
            waves.iter().map(|[kx, ky, phase, a]| a * (kx * x as f32 + ky * y as f32 + phase).sin()).sum();
        (z * scale * (1.0 + ripple) * 1000.0).round() / 1000.0
    })
}

fn normal(stream: &mut Stream) -> f32 {
    StandardNormal.sample(stream)
}

/// Downscales depth to `width` × `height` (means of measured inverse depth), fills unmeasured pixels, and smooths by
/// `blur_px` of the low resolution.
///
/// `measured` is false where the sensor receives no light. If nothing at all is measured, the result is all 0.
fn fuse(depth_m: &DepthMap, measured: &Image<bool>, width: usize, height: usize, blur_px: f32) -> DepthMap {
    // Inverse depth is affine on planes, so means stay on them. Edges smear as in real maps.
    let mut level = PyramidLevel::new(width, height);
    for y in 0..height {
        for x in 0..width {
            let (xs, ys) = (
                x * depth_m.width() / width..((x + 1) * depth_m.width()).div_ceil(width),
                y * depth_m.height() / height..((y + 1) * depth_m.height()).div_ceil(height),
            );
            for row in ys {
                for column in xs.clone() {
                    if measured[(column, row)] && depth_m[(column, row)] > 0.0 {
                        level.add(x, y, 1.0 / depth_m[(column, row)]);
                    }
                }
            }
        }
    }
    let filled = level.filled();
    let smooth = blurred(&filled, blur_px);
    smooth.map(|&inverse| if inverse > 0.0 { 1.0 / inverse } else { 0.0 })
}

/// Pyramid level of the "pull-push" algorithm (Gortler et al., "The Lumigraph", 1996, section 3.4): sums and weights.
struct PyramidLevel {
    sum: Image<f32>,
    weight: Image<f32>,
}

impl PyramidLevel {
    fn new(width: usize, height: usize) -> Self {
        let zeros = || Image::new(width, height, vec![0.0; width * height]);
        Self { sum: zeros(), weight: zeros() }
    }

    fn add(&mut self, x: usize, y: usize, value: f32) {
        self.sum[(x, y)] += value;
        self.weight[(x, y)] += 1.0;
    }

    /// Returns means where there is weight, and the coarser level's values elsewhere. 0 if there is no weight at all.
    fn filled(&self) -> Image<f32> {
        let (width, height) = (self.sum.width(), self.sum.height());
        let complete = self.weight.pixels().iter().all(|&w| w > 0.0);
        let coarse = if complete || width * height <= 1 {
            None
        } else {
            let mut coarse = Self::new(width.div_ceil(2), height.div_ceil(2));
            for y in 0..height {
                for x in 0..width {
                    if self.weight[(x, y)] > 0.0 {
                        coarse.add(x / 2, y / 2, self.sum[(x, y)] / self.weight[(x, y)]);
                    }
                }
            }
            Some(coarse.filled())
        };
        Image::from_fn(width, height, |x, y| match (&coarse, self.weight[(x, y)]) {
            (_, weight) if weight > 0.0 => self.sum[(x, y)] / weight,
            (Some(coarse), _) => coarse[(x / 2, y / 2)],
            (None, _) => 0.0,
        })
    }
}

/// Gaussian blur with clamped borders.
fn blurred(image: &Image<f32>, sigma_px: f32) -> Image<f32> {
    let radius = (3.0 * sigma_px).ceil() as isize;
    if radius <= 0 {
        return image.clone();
    }
    let weights: Vec<f32> = (-radius..=radius).map(|i| (-0.5 * (i as f32 / sigma_px).powi(2)).exp()).collect();
    let total: f32 = weights.iter().sum();
    let (width, height) = (image.width(), image.height());
    let clamped = |position: usize, offset: isize, count: usize| position.saturating_add_signed(offset).min(count - 1);
    let pass = |source: &Image<f32>, along_x: bool| {
        Image::from_fn(width, height, |x, y| {
            let sum: f32 = (-radius..=radius)
                .zip(&weights)
                .map(|(i, w)| {
                    let at = if along_x { (clamped(x, i, width), y) } else { (x, clamped(y, i, height)) };
                    w * source[at]
                })
                .sum();
            sum / total
        })
    };
    pass(&pass(image, true), false)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn planes_stay_planes_and_holes_are_filled() {
        // A slanted plane: inverse depth is affine in the image.
        let depth = DepthMap::from_fn(480, 320, |x, y| 1.0 / (0.2 + 0.0005 * x as f32 + 0.0002 * y as f32));
        let all = Image::new(480, 320, vec![true; 480 * 320]);
        let fused_map = fuse(&depth, &all, 240, 160, 1.0);
        for (x, y) in [(20, 30), (120, 80), (200, 140)] {
            let expected = 1.0 / (0.2 + 0.0005 * (2.0 * x as f32 + 0.5) + 0.0002 * (2.0 * y as f32 + 0.5));
            assert!((fused_map[(x, y)] - expected).abs() < 2e-3, "{} instead of {expected}", fused_map[(x, y)]);
        }
        let with_hole = Image::from_fn(480, 320, |x, y| !(100..220).contains(&x) || !(100..180).contains(&y));
        let filled = fuse(&depth, &with_hole, 240, 160, 1.0);
        let worst =
            filled.pixels().iter().zip(fused_map.pixels()).map(|(a, b)| (a / b - 1.0).abs()).fold(0.0, f32::max);
        // Across the hole the plane changes by 20 %; filled values are in between.
        assert!(filled.pixels().iter().all(|&z| z > 0.0) && worst < 0.2, "{worst}");
    }

    #[test]
    fn nothing_measured_gives_nothing() {
        let depth = DepthMap::new(8, 8, vec![2.0; 64]);
        let none = Image::new(8, 8, vec![false; 64]);
        assert!(fuse(&depth, &none, 4, 4, 1.0).pixels().iter().all(|&z| z == 0.0));
    }
}
