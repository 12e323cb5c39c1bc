use std::sync::LazyLock;

use lo_geometry::Vec3;
use lo_imaging::{ChannelGroup, EncodedPhoto, Image, Photo, RadianceImage, linear_from_srgb8};
use rayon::prelude::*;

use crate::shade::redistortion::Redistortion;
use crate::shade::visibility::{Hidden, TileView};

/// A photo with inserted objects, and its layers, all of the photo's size.
#[derive(Clone, Debug)]
pub struct Composite {
    /// The composite, of the photo's type. Pixels that the objects do not change are bit-identical to the photo's.
    pub image: Photo,
    /// Linear RGB radiance of the objects, premultiplied by `alpha`. Along soft edges of occluders, the photo's old
    /// background is subtracted, so that it can be negative.
    ///
    /// The composite is `(photo · shadow_ratio + reflection) · (1 − alpha) + object`.
    pub object: RadianceImage,
    /// Share of each pixel that shows an object, in [0, 1].
    pub alpha: Image<f32>,
    /// Factor on the photo for shadow and bounced light; exactly 1 if unaffected.
    pub shadow_ratio: RadianceImage,
    /// Linear RGB radiance that the objects' reflection in a glossy support adds to the photo, negative where it
    /// hides an earlier reflection. `None` without gloss.
    pub reflection: Option<RadianceImage>,
    /// Share of each pixel in which real surfaces hide an object, in [0, 1].
    pub occlusion: Image<f32>,
}

/// Layers of the objects during rendering.
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
        for &Hidden { pixel, share, .. } in &view.hidden {
            self.occlusion[pixel] += share;
        }
    }

    /// Distorts the layers back to the photo as its lens took it.
    pub fn distorted(self, back: &Redistortion) -> Self {
        Self {
            object: back.layer(&self.object, Vec3::ZERO),
            alpha: back.layer(&self.alpha, 0.0),
            occlusion: back.layer(&self.occlusion, 0.0),
        }
    }

    /// Removes everything from a pixel.
    pub fn clear(&mut self, pixel: (usize, usize)) {
        self.object[pixel] = Vec3::ZERO;
        self.alpha[pixel] = 0.0;
        self.occlusion[pixel] = 0.0;
    }

    /// Removes the old background from the occluder's colour at a pixel of a soft edge: `change` is the occluder's
    /// radiance minus the photo's.
    pub fn clear_edge(&mut self, pixel: (usize, usize), change: Vec3) {
        if self.alpha[pixel] > 0.0 {
            self.object[pixel] += change * self.occlusion[pixel];
        }
    }
}

/// Table-based `lo_imaging::srgb8_from_linear`.
struct SrgbTable {
    /// Linear values half-way between each code and the next.
    limits: [f32; 255],
    /// Code at the lower end of each interval from [`SrgbTable::LOWEST`] to 1, with 64 intervals per octave.
    codes: [u8; 13 * 64],
}

impl SrgbTable {
    /// Start of the table, below the first limit.
    const LOWEST: f32 = 1.0 / 8192.0;

    fn get() -> &'static Self {
        static TABLE: LazyLock<SrgbTable> = LazyLock::new(|| {
            let limits = std::array::from_fn(|i| lo_imaging::linear_from_srgb((i as f32 + 0.5) / 255.0));
            let lower_end = |piece: usize| f32::from_bits(SrgbTable::LOWEST.to_bits() + ((piece as u32) << 17));
            let code = |piece| limits.partition_point(|&limit| limit <= lower_end(piece)) as u8;
            SrgbTable { limits, codes: std::array::from_fn(code) }
        });
        &TABLE
    }

    fn code(&self, value: f32) -> u8 {
        if value >= self.limits[254] {
            return 255;
        }
        if value.is_nan() || value < Self::LOWEST {
            return 0;
        }
        let piece = (value.to_bits() - Self::LOWEST.to_bits()) >> 17;
        let mut code = self.codes[piece as usize];
        while value >= self.limits[usize::from(code)] {
            code += 1;
        }
        code
    }
}

impl Composite {
    /// Returns the layers of an OpenEXR file: `object` (premultiplied, with alpha), `shadow_ratio`, `occlusion`, and
    /// `reflection` if present.
    pub fn channels(&self) -> Vec<ChannelGroup> {
        let groups = [
            ChannelGroup::rgb("object", &self.object),
            ChannelGroup::single("object", "A", &self.alpha),
            ChannelGroup::rgb("shadow_ratio", &self.shadow_ratio),
            ChannelGroup::single("occlusion", "A", &self.occlusion),
        ];
        let reflection = self.reflection.as_ref().map(|reflection| ChannelGroup::rgb("reflection", reflection));
        groups.into_iter().chain(reflection).collect()
    }

    pub(crate) fn new(
        photo: &Photo,
        exposure: f32,
        layers: Layers,
        shadow_ratio: RadianceImage,
        reflection: Option<RadianceImage>,
    ) -> Self {
        let reflected = |i: usize| reflection.as_ref().map_or(Vec3::ZERO, |image| Vec3::from(image.pixels()[i]));
        let changed = |i: usize| {
            layers.alpha.pixels()[i] > 0.0 || shadow_ratio.pixels()[i] != [1.0; 3] || reflected(i) != Vec3::ZERO
        };
        let blended = |i: usize, photo: Vec3| {
            let floor = photo * Vec3::from(shadow_ratio.pixels()[i]) + reflected(i) / exposure;
            let under = floor.max(photo.min(Vec3::ZERO)) * (1.0 - layers.alpha.pixels()[i]);
            under + layers.object.pixels()[i] / exposure
        };
        let mixed = |i: usize, photo: Vec3| blended(i, photo).max(Vec3::ZERO);
        let table = SrgbTable::get();
        let mut image = photo.clone();
        match &mut image {
            Photo::Srgb8(image) => image.pixels_mut().par_iter_mut().enumerate().for_each(|(i, pixel)| {
                if changed(i) {
                    let photo = Vec3::from(pixel.map(linear_from_srgb8));
                    *pixel = mixed(i, photo).to_array().map(|value| table.code(value));
                }
            }),
            Photo::Encoded8(EncodedPhoto { image, encoding }) => {
                image.pixels_mut().par_iter_mut().enumerate().for_each(|(i, pixel)| {
                    if changed(i) {
                        // not clamped: colours outside of Rec. 709 stay
                        *pixel = encoding.code(blended(i, Vec3::from(encoding.linear(*pixel))).to_array());
                    }
                });
            }
            Photo::Linear(image) => image.pixels_mut().par_iter_mut().enumerate().for_each(|(i, pixel)| {
                if changed(i) {
                    *pixel = mixed(i, Vec3::from(*pixel)).to_array();
                }
            }),
        }
        let object = layers.object.map(|radiance| radiance.to_array());
        Self { image, object, alpha: layers.alpha, shadow_ratio, reflection, occlusion: layers.occlusion }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn table_of_codes_is_the_curve() {
        let table = SrgbTable::get();
        let even = (0..40_000).map(|i| -0.1 + 1.2 * i as f32 / 40_000.0);
        let dark = (0..4000).map(|i| 1e-3 * i as f32 / 4000.0);
        for value in even.chain(dark).chain([f32::MIN, f32::MAX, f32::INFINITY, f32::NEG_INFINITY, f32::NAN]) {
            assert_eq!(table.code(value), lo_imaging::srgb8_from_linear(value), "{value}");
        }
    }
}
