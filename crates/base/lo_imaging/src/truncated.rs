//! The part of a cut-off JPEG that its decoder could not fill.

use image::DynamicImage;

/// Value of pixels that a JPEG decoder fills in: coefficients of 0 are middle grey.
const FILLED: u8 = 128;

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

/// Makes rows at the bottom black, so that they are taken for a black bar and not for floor.
pub(crate) fn blacken(decoded: DynamicImage, rows: usize) -> DynamicImage {
    let mut rgb = decoded.into_rgb8();
    let first = 3 * rgb.width() as usize * (rgb.height() as usize - rows);
    let samples: &mut [u8] = &mut rgb;
    samples[first..].fill(0);
    DynamicImage::from(rgb)
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn rows_filled_in_are_counted() {
        let image =
            image::RgbImage::from_fn(20, 48, |_, y| image::Rgb(if y < 32 { [10, 20, 30] } else { [FILLED; 3] }));
        assert_eq!(missing_rows(&DynamicImage::from(image)), 16 + 16 + 2);
        let grey = image::RgbImage::from_pixel(20, 48, image::Rgb([FILLED; 3]));
        assert_eq!(missing_rows(&DynamicImage::from(grey)), 48);
    }
}
