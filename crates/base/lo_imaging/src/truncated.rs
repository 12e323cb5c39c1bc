//! The part of a cut-off JPEG that its decoder could not fill.

use image::DynamicImage;
use image::metadata::Orientation;

/// Value of pixels that a JPEG decoder fills in: coefficients of 0 are middle grey.
const FILLED: u8 = 128;

/// Widths of a picture's borders that hold nothing, in pixels.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Margins {
    /// On the left.
    pub left: usize,
    /// At the top.
    pub top: usize,
    /// On the right.
    pub right: usize,
    /// At the bottom.
    pub bottom: usize,
}

impl Margins {
    /// Margins with rows at the bottom only.
    pub(crate) fn below(rows: usize) -> Self {
        Self { bottom: rows, ..Self::default() }
    }

    /// Returns the margins after an EXIF orientation is applied.
    pub(crate) fn oriented(self, orientation: Orientation) -> Self {
        let Self { left, top, right, bottom } = self;
        let flipped = Self { left: right, right: left, ..self };
        match orientation {
            Orientation::NoTransforms => self,
            Orientation::FlipHorizontal => flipped,
            Orientation::FlipVertical => Self { top: bottom, bottom: top, ..self },
            Orientation::Rotate180 => Self { left: right, top: bottom, right: left, bottom: top },
            Orientation::Rotate90 => Self { left: bottom, top: left, right: top, bottom: right },
            Orientation::Rotate270 => Self { left: top, top: right, right: bottom, bottom: left },
            Orientation::Rotate90FlipH => flipped_horizontally(self.oriented(Orientation::Rotate90)),
            Orientation::Rotate270FlipH => flipped_horizontally(self.oriented(Orientation::Rotate270)),
        }
    }
}

fn flipped_horizontally(margins: Margins) -> Margins {
    Margins { left: margins.right, right: margins.left, ..margins }
}

/// Counts the rows at the bottom of a picture that the decoder of a cut-off JPEG filled in, wholly or in part.
pub(crate) fn missing_rows(decoded: &DynamicImage) -> usize {
    let rgb = decoded.to_rgb8();
    let (width, height) = (rgb.width() as usize, rgb.height() as usize);
    let tail = 3 * width.min(8);
    let samples = rgb.as_raw();
    let filled_in = |y: &usize| samples[3 * width * (y + 1) - tail..3 * width * (y + 1)].iter().all(|&v| v == FILLED);
    match (0..height).rev().take_while(filled_in).count() {
        0 => 0,
        // The blocks above, of at most sixteen rows, are complete on the left only; chroma at their border is
        // interpolated with the grey.
        rows => height - ((height - rows) / 8 * 8).saturating_sub(16 + 2),
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn margins_follow_the_orientation() {
        let orientations = [
            Orientation::NoTransforms,
            Orientation::FlipHorizontal,
            Orientation::FlipVertical,
            Orientation::Rotate180,
            Orientation::Rotate90,
            Orientation::Rotate270,
            Orientation::Rotate90FlipH,
            Orientation::Rotate270FlipH,
        ];
        let margins = Margins { left: 1, top: 2, right: 3, bottom: 4 };
        for orientation in orientations {
            // a picture whose inner part is white
            let (width, height) = (9u32, 11u32);
            let inside = |x: u32, y: u32| (1..width - 3).contains(&x) && (2..height - 4).contains(&y);
            let mut image = DynamicImage::from(image::GrayImage::from_fn(width, height, |x, y| {
                image::Luma([if inside(x, y) { 255 } else { 0 }])
            }));
            image.apply_orientation(orientation);
            let grey = image.to_luma8();
            let found = margins.oriented(orientation);
            for (x, y, pixel) in grey.enumerate_pixels() {
                let (right, bottom) = (grey.width() as usize - found.right, grey.height() as usize - found.bottom);
                let inside = (found.left..right).contains(&(x as usize)) && (found.top..bottom).contains(&(y as usize));
                assert_eq!(pixel.0[0] == 255, inside, "{orientation:?} {x} {y}");
            }
        }
    }

    #[test]
    fn rows_filled_in_are_counted() {
        let image = image::RgbImage::from_fn(20, 48, |_, y| image::Rgb(if y < 32 { [10, 20, 30] } else { [FILLED; 3] }));
        assert_eq!(missing_rows(&DynamicImage::from(image)), 16 + 16 + 2);
        let grey = image::RgbImage::from_pixel(20, 48, image::Rgb([FILLED; 3]));
        assert_eq!(missing_rows(&DynamicImage::from(grey)), 48);
    }
}
