//! Metric3D v2: canonical depth to metres, and removal of the padding. Hu et al., "Metric3D v2" (TPAMI 2024).

use lo_imaging::{DepthMap, Image};

/// Width of the network's input.
pub(crate) const WIDTH: usize = 1064;
/// Height of the network's input.
pub(crate) const HEIGHT: usize = 616;
/// Mean that is subtracted from values of 0 to 255, and the colour of the padding.
pub(crate) const MEAN: [f32; 3] = [123.675, 116.28, 103.53];
/// Standard deviation that values are divided by.
pub(crate) const DEVIATION: [f32; 3] = [58.395, 57.12, 57.375];
/// Focal length of the canonical camera, in pixels.
pub(crate) const CANONICAL_FOCAL_PX: f64 = 1000.0;
/// Largest expected error of a usable normal. A choice, not a measurement.
const MOST_ERROR_DEG: f64 = 30.0;

/// A photo centred in an image of another aspect ratio.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Letterbox {
    /// Width of the padded image.
    pub outer_width: usize,
    /// Height of the padded image.
    pub outer_height: usize,
    /// Width of the photo in it.
    pub width: usize,
    /// Height of the photo in it.
    pub height: usize,
    /// Columns to the left of the photo.
    pub left: usize,
    /// Rows above the photo.
    pub top: usize,
}

impl Letterbox {
    /// Fits a photo of `photo` pixels, at least one, as large as possible.
    pub fn of(photo: (usize, usize), (outer_width, outer_height): (usize, usize)) -> Self {
        let scale = (outer_width as f64 / photo.0 as f64).min(outer_height as f64 / photo.1 as f64);
        // Rounding must not make 615 of 616/480 · 480.
        let side = |pixels: usize, most: usize| ((pixels as f64 * scale + 1e-6) as usize).clamp(1, most);
        let (width, height) = (side(photo.0, outer_width), side(photo.1, outer_height));
        Self {
            outer_width,
            outer_height,
            width,
            height,
            left: (outer_width - width) / 2,
            top: (outer_height - height) / 2,
        }
    }

    /// Surrounds the photo, already resized to [`Self::width`] × [`Self::height`], with `padding`.
    pub fn padded<T: Copy>(&self, photo: &Image<T>, padding: T) -> Image<T> {
        assert_eq!(
            (photo.width(), photo.height()),
            (self.width, self.height),
            "the photo was resized for another letterbox"
        );
        Image::from_fn(self.outer_width, self.outer_height, |x, y| {
            let inside = (x.wrapping_sub(self.left), y.wrapping_sub(self.top));
            let there = inside.0 < self.width && inside.1 < self.height;
            if there { photo.pixels()[inside.1 * self.width + inside.0] } else { padding }
        })
    }

    /// Crops an image of the padded extent, at any resolution, to the photo.
    pub fn cropped<T: Copy>(&self, whole: &Image<T>) -> Image<T> {
        let at =
            |pixels: usize, outer: usize, size: usize| (pixels as f64 * size as f64 / outer as f64).round() as usize;
        let (width, height) = (whole.width(), whole.height());
        let (left, top) = (at(self.left, self.outer_width, width), at(self.top, self.outer_height, height));
        let right = at(self.left + self.width, self.outer_width, width);
        let bottom = at(self.top + self.height, self.outer_height, height);
        Image::from_fn(right - left, bottom - top, |x, y| whole.pixels()[(top + y) * width + left + x])
    }
}

/// Converts canonical depth to metres; 0 where it is not finite or not positive.
///
/// `focal_px` is the camera's focal length in pixels of the resized photo without padding.
pub(crate) fn metres(canonical: &Image<f32>, focal_px: f64) -> DepthMap {
    canonical.map(|&z| {
        let metres = (f64::from(z) * focal_px / CANONICAL_FOCAL_PX) as f32;
        if metres.is_finite() && metres > 0.0 { metres } else { 0.0 }
    })
}

/// Normals with an expected error of at most 30 degrees, by the network's concentration κ; zero elsewhere.
pub(crate) fn reliable_normals(normals: &Image<[f32; 3]>, concentration: &Image<f32>) -> Image<[f32; 3]> {
    let (width, height) = (normals.width(), normals.height());
    Image::from_fn(width, height, |x, y| {
        let index = y * width + x;
        let error = concentration.pixels().get(index).map_or(f64::NAN, |&kappa| expected_error_rad(f64::from(kappa)));
        if error.to_degrees() <= MOST_ERROR_DEG { normals.pixels()[index] } else { [0.0; 3] }
    })
}

/// Expected angle between a normal and the truth under the angular von Mises–Fisher distribution of concentration κ.
///
/// Source: Bae, Budvytis and Cipolla, "Estimating and exploiting the aleatoric uncertainty in surface normal
/// estimation" (ICCV 2021), equation 5.
fn expected_error_rad(kappa: f64) -> f64 {
    let tail = (-kappa * std::f64::consts::PI).exp();
    2.0 * kappa / (kappa * kappa + 1.0) + tail * std::f64::consts::PI / (1.0 + tail)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn photos_fit_as_their_publisher_fits_them() {
        let whole = (WIDTH, HEIGHT);
        // int(1920 · 616/1440) = 821; 1064 − 821 = 243, halves 121 and 122
        let four_to_three = Letterbox::of((1920, 1440), whole);
        assert_eq!(
            four_to_three,
            Letterbox { outer_width: 1064, outer_height: 616, width: 821, height: 616, left: 121, top: 0 }
        );
        let wide = Letterbox::of((1242, 375), whole);
        assert_eq!((wide.width, wide.height, wide.left, wide.top), (1064, 321, 0, 147));
        let upright = Letterbox::of((480, 640), whole);
        assert_eq!((upright.width, upright.height, upright.left), (462, 616, 301));
        assert_eq!(Letterbox::of((1, 100_000), whole).width, 1);
    }

    proptest! {
        #[test]
        fn cropping_undoes_padding(width in 1usize..3000, height in 1usize..3000) {
            let letterbox = Letterbox::of((width, height), (106, 62));
            let photo = Image::from_fn(letterbox.width, letterbox.height, |x, y| (x, y));
            let padded = letterbox.padded(&photo, (999, 999));
            prop_assert_eq!((padded.width(), padded.height()), (106, 62));
            prop_assert_eq!(letterbox.cropped(&padded), photo);
            prop_assert!(letterbox.width == 106 || letterbox.height == 62);
        }
    }

    #[test]
    fn coarser_outputs_are_cropped_in_proportion() {
        let letterbox = Letterbox::of((1920, 1440), (WIDTH, HEIGHT));
        let quarter = Image::from_fn(266, 154, |x, _| x);
        let cropped = letterbox.cropped(&quarter);
        // 121/4 and 942/4, rounded.
        assert_eq!((cropped.width(), cropped.height(), cropped.pixels()[0]), (206, 154, 30));
    }

    #[test]
    fn metres_are_canonical_depth_by_the_focal_length() {
        let canonical = Image::new(5, 1, vec![2.0, 0.0, -1.0, f32::NAN, f32::INFINITY]);
        assert_eq!(metres(&canonical, 700.0).pixels(), [1.4, 0.0, 0.0, 0.0, 0.0]);
    }

    #[test]
    fn expected_error_is_that_of_the_distribution() {
        // ∫ α p(α) dα with p ∝ sin α · e^(−κ α), as sums over a million steps.
        for kappa in [0.5, 1.0, 3.0, 20.0f64] {
            let (mut sum, mut weighted) = (0.0, 0.0);
            for step in 0..1_000_000 {
                let angle = (f64::from(step) + 0.5) * 1e-6 * std::f64::consts::PI;
                let density = angle.sin() * (-kappa * angle).exp();
                (sum, weighted) = (sum + density, weighted + angle * density);
            }
            assert!((expected_error_rad(kappa) - weighted / sum).abs() < 1e-9, "{kappa}");
        }
    }

    #[test]
    fn normals_of_low_concentration_are_discarded() {
        let normals = Image::new(4, 1, vec![[0.0, 0.0, -1.0]; 4]);
        let concentration = Image::new(4, 1, vec![20.0, 1.0, f32::NAN, 4.0]);
        let reliable = reliable_normals(&normals, &concentration);
        assert_eq!(reliable.pixels(), [[0.0, 0.0, -1.0], [0.0; 3], [0.0; 3], [0.0, 0.0, -1.0]]);
        assert_eq!(reliable_normals(&normals, &Image::new(0, 0, Vec::new())).pixels(), [[0.0; 3]; 4]);
    }
}
