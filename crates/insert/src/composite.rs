use std::sync::LazyLock;

use geometry::Vec3;
use imaging::{Image, Photo, RadianceImage, linear_from_srgb8, srgb8_from_linear};
use rayon::prelude::*;
use scene::Frame;

use crate::visibility::TileView;

/// A photo with an object in it, and the layers that it was made of; all of the photo's size.
#[derive(Clone, Debug)]
pub struct Composite {
    /// The picture, of the same kind as the photo. Pixels that the object does not change are the photo's own, bit by bit.
    pub image: Photo,
    /// Linear RGB radiance of the object, premultiplied by `alpha`.
    pub object: RadianceImage,
    /// Share of each pixel that shows the object, in [0, 1].
    pub alpha: Image<f32>,
    /// Factor on the photo for shadow and bounced light; exactly 1 where there is none.
    pub shadow_ratio: RadianceImage,
    /// Share of each pixel where the object is hidden by real surfaces, in [0, 1].
    pub occlusion: Image<f32>,
    /// What the user should know about this picture.
    pub warnings: Vec<String>,
}

/// The object's layers while they are made.
pub(crate) struct Layers {
    object: Image<Vec3>,
    alpha: Image<f32>,
    occlusion: Image<f32>,
}

impl Layers {
    pub fn new(width: usize, height: usize) -> Self {
        let empty = Image::new(width, height, vec![0.0; width * height]);
        Self {
            object: Image::new(width, height, vec![Vec3::ZERO; width * height]),
            alpha: empty.clone(),
            occlusion: empty,
        }
    }

    pub fn add(&mut self, view: &TileView, radiance: &[Vec3]) {
        for (fragment, radiance) in view.fragments.iter().zip(radiance) {
            self.object[fragment.pixel] += *radiance * fragment.weight;
            let alpha = &mut self.alpha[fragment.pixel];
            *alpha = (*alpha + fragment.weight).min(1.0);
        }
        for &(pixel, share) in &view.hidden {
            self.occlusion[pixel] += share;
        }
    }

    pub fn covers_anything(&self) -> bool {
        self.alpha.pixels().iter().any(|&alpha| alpha > 0.0)
    }

    pub fn hides_anything(&self) -> bool {
        self.occlusion.pixels().iter().any(|&share| share > 0.0)
    }
}

/// [`srgb8_from_linear`], faster where the result is near the code that a pixel has: most of a shadow is faint.
fn nearest_srgb8(value: f32, code: u8) -> u8 {
    /// Linear values half-way between code i and the next.
    static LIMITS: LazyLock<[f32; 255]> =
        LazyLock::new(|| std::array::from_fn(|i| imaging::linear_from_srgb((i as f32 + 0.5) / 255.0)));
    let below = |code: u8| code == 0 || value >= LIMITS[usize::from(code) - 1];
    let above = |code: u8| code == 255 || value < LIMITS[usize::from(code)];
    let near = [code, code.saturating_sub(1), code.saturating_sub(2)];
    near.into_iter().find(|&code| below(code) && above(code)).unwrap_or_else(|| srgb8_from_linear(value))
}

impl Composite {
    pub(crate) fn new(frame: &Frame, layers: Layers, shadow_ratio: RadianceImage, warnings: Vec<String>) -> Self {
        let changed = |i: usize| layers.alpha.pixels()[i] > 0.0 || shadow_ratio.pixels()[i] != [1.0; 3];
        let mixed = |i: usize, photo: Vec3| {
            let under = photo * Vec3::from(shadow_ratio.pixels()[i]) * (1.0 - layers.alpha.pixels()[i]);
            under + layers.object.pixels()[i] / frame.exposure
        };
        let mut image = frame.photo.clone();
        match &mut image {
            Photo::Srgb8(image) => image.pixels_mut().par_iter_mut().enumerate().for_each(|(i, pixel)| {
                if changed(i) {
                    let photo = Vec3::from(pixel.map(linear_from_srgb8));
                    let mixed = mixed(i, photo).to_array();
                    *pixel = std::array::from_fn(|channel| nearest_srgb8(mixed[channel], pixel[channel]));
                }
            }),
            Photo::Linear(image) => image.pixels_mut().par_iter_mut().enumerate().for_each(|(i, pixel)| {
                if changed(i) {
                    *pixel = mixed(i, Vec3::from(*pixel)).to_array();
                }
            }),
        }
        let object = layers.object.map(|radiance| radiance.to_array());
        Self { image, object, alpha: layers.alpha, shadow_ratio, occlusion: layers.occlusion, warnings }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn short_way_to_a_code_is_the_nearest_code() {
        for i in 0..4000 {
            let value = -0.1 + 1.2 * i as f32 / 4000.0;
            for code in [0, 1, 7, 100, 254, 255, srgb8_from_linear(value), srgb8_from_linear(value).saturating_add(1)] {
                assert_eq!(nearest_srgb8(value, code), srgb8_from_linear(value), "{value} {code}");
            }
        }
        assert_eq!(nearest_srgb8(f32::NAN, 9), 0);
    }
}
