//! A photo is looked at twice, the second time mirrored and a little coarser: two looks err less than one, as a mean of two networks does.

use lo_imaging::{DepthMap, Image, resize_depth};
use rayon::prelude::*;

use crate::depth::photo_within;

/// Pixels of the second look on the longer side, as a share of the first one's. Chosen among 1, 0.8 and 0.65 on the five real rooms that validate:
/// depth is off by 0.317, 0.308 and 0.315, with one look by 0.324 (`docs/training.md`).
const SHARE: f64 = 0.8;

/// The median of depth reaches one pixel to each side for every so many pixels of the longer side. Of 320 pixels 2, 3 and 5 to each side are alike in figures;
/// pictures are clean from 3 on.
const PIXELS_A_STEP: usize = 100;

/// What the second look sees of a photo of which the first sees so many pixels on the longer side.
pub(crate) fn picture(photo: &Image<[u8; 3]>, longer_side: usize) -> Image<[u8; 3]> {
    mirrored(&photo_within(photo, (SHARE * longer_side as f64).round() as usize))
}

/// The geometric mean of both looks' depths, in the first one's resolution.
pub(crate) fn mean_depth(first: &DepthMap, second: &DepthMap) -> DepthMap {
    let second = resize_depth(&mirrored(second), first.width(), first.height());
    let pixels = first.pixels().iter().zip(second.pixels()).map(|(a, b)| (a * b).sqrt());
    DepthMap::new(first.width(), first.height(), pixels.collect())
}

/// Without the grain that a network of few photos leaves: medians of each pixel's surroundings, which keep edges. It hardly changes how far off depth is
/// (five real rooms 0.308 and 0.307), but what cones meet at grazing angles, and where shadows fall.
pub(crate) fn without_grain(depth_m: &DepthMap) -> DepthMap {
    let (width, height) = (depth_m.width(), depth_m.height());
    let radius = (width.max(height) + PIXELS_A_STEP / 2) / PIXELS_A_STEP;
    let near = |at: usize, size: usize| at.saturating_sub(radius)..(at + radius + 1).min(size);
    let rows = (0..height).into_par_iter().flat_map_iter(|y| {
        let mut around = Vec::new();
        (0..width).map(move |x| {
            around.clear();
            around.extend(near(y, height).flat_map(|row| &depth_m.pixels()[row * width..][near(x, width)]));
            let middle = around.len() / 2;
            *around.select_nth_unstable_by(middle, f32::total_cmp).1
        })
    });
    DepthMap::new(width, height, rows.collect())
}

/// Left and right exchanged.
fn mirrored<T: Copy>(image: &Image<T>) -> Image<T> {
    Image::from_fn(image.width(), image.height(), |x, y| image[(image.width() - 1 - x, y)])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_mean_lies_between_both_and_its_sides_are_not_exchanged() {
        let first = DepthMap::from_fn(10, 6, |x, _| 1.0 + x as f32);
        let second = DepthMap::from_fn(8, 5, |x, _| 4.0 * (10.0 - 10.0 * (x as f32 + 0.5) / 8.0 + 0.5));
        let mean = mean_depth(&first, &second);
        for x in 1..9 {
            let (found, expected) = (mean[(x, 3)], 2.0 * first[(x, 3)]);
            assert!((found / expected - 1.0).abs() < 0.2, "{x}: {found} for {expected}");
        }
        let photo = Image::from_fn(40, 20, |x, _| [x as u8; 3]);
        let seen = picture(&photo, 20);
        assert_eq!((seen.width(), seen.height()), (16, 8));
        assert!(seen[(0, 0)][0] > seen[(15, 0)][0]);
    }

    #[test]
    fn grain_goes_and_edges_stay() {
        // Two walls and an even floor below them.
        let clean = |x: usize, y: usize| if y < 120 { [2.0, 5.0][x / 160] } else { 1.0 + 0.01 * (239 - y) as f32 };
        let grainy = DepthMap::from_fn(320, 240, |x, y| {
            let is_grain = (7 * x + 11 * y) % 5 == 0;
            clean(x, y) * if is_grain { 1.2 } else { 1.0 }
        });
        let found = without_grain(&grainy);
        for (x, y) in [(3, 5), (156, 50), (163, 50), (300, 5), (5, 180), (180, 200), (0, 0), (319, 239)] {
            assert!((found[(x, y)] / clean(x, y) - 1.0).abs() < 0.05, "{x}, {y}: {}", found[(x, y)]);
        }
        // At most what grain there is, and nothing in between.
        assert!((2.0..2.5).contains(&found[(159, 50)]) && (5.0..6.5).contains(&found[(160, 50)]));
        let small = DepthMap::new(1, 1, vec![3.0]);
        assert_eq!(without_grain(&small), small);
    }
}
