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
                    *pixel = mixed(i, photo).to_array().map(srgb8_from_linear);
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
