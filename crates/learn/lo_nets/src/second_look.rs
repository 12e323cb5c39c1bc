//! A photo is looked at twice, the second time mirrored and a little coarser: two looks err less than one, as a mean of two networks does.

use lo_geometry::FieldCell;
use lo_imaging::{DepthMap, Image, resize_depth};

use crate::depth::photo_within;

/// Pixels of the second look on the longer side, as a share of the first one's. Chosen among 1, 0.8 and 0.65 on the five real rooms that validate:
/// depth is off by 0.317, 0.308 and 0.315, with one look by 0.324 (`docs/training.md`).
const SHARE: f64 = 0.8;

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

/// What both looks say of the camera.
pub(crate) fn field(first: Vec<FieldCell>, second: &[FieldCell]) -> Vec<FieldCell> {
    first.into_iter().chain(second.iter().map(FieldCell::mirrored)).collect()
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
}
