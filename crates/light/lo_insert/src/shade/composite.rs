use std::sync::LazyLock;

use lo_geometry::Vec3;
use lo_imaging::{
    ChannelGroup, EncodedPhoto, Image, Photo, RadianceImage, linear_from_srgb, linear_from_srgb8, srgb_from_linear,
};
use rayon::prelude::*;

use crate::look::{Cover, Grain, softened};
use crate::shade::passes::Passes;
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
    /// The composite is `(photo · shadow_ratio + reflection) · (1 − alpha) + object + grain`.
    pub object: RadianceImage,
    /// Share of each pixel that shows an object, in [0, 1].
    pub alpha: Image<f32>,
    /// Factor on the photo for shadow and bounced light; exactly 1 if unaffected.
    pub shadow_ratio: RadianceImage,
    /// Linear RGB radiance that the objects' reflection in a glossy support adds to the photo, negative where it
    /// hides an earlier reflection. `None` without gloss.
    pub reflection: Option<RadianceImage>,
    /// Linear RGB radiance that the photo's grain adds to the objects. `None` if it is not matched, or the photo has
    /// none.
    pub grain: Option<RadianceImage>,
    /// Share of each pixel in which real surfaces hide an object, in [0, 1].
    pub occlusion: Image<f32>,
    /// Passes for compositing, if asked for.
    pub passes: Option<Box<Passes>>,
}

/// Layers of the objects during rendering.
pub(crate) struct Layers {
    pub object: Image<Vec3>,
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

    /// Like [`add`](Self::add), with each object blurred by a standard deviation in pixels.
    pub fn add_softened(&mut self, view: &TileView, radiance: &[Vec3], blurs_px: &[f32]) {
        for (object, &blur_px) in blurs_px.iter().enumerate() {
            let shown = view.fragments.iter().zip(radiance).filter(|(fragment, _)| fragment.object == object);
            let hidden = view.hidden.iter().filter(|hidden| hidden.object == object);
            let pixels = shown.clone().map(|(fragment, _)| fragment.pixel).chain(hidden.clone().map(|h| h.pixel));
            let Some(window) = Window::around(pixels, blur_px, [self.alpha.width(), self.alpha.height()]) else {
                continue;
            };
            let mut cover =
                Image::new(window.width, window.height, vec![Cover::default(); window.width * window.height]);
            for (fragment, radiance) in shown {
                let pixel = &mut cover[window.inside(fragment.pixel)];
                pixel.radiance += *radiance * fragment.weight;
                pixel.visible = (pixel.visible + fragment.weight).min(1.0);
            }
            for hidden in hidden {
                cover[window.inside(hidden.pixel)].hidden += hidden.share;
            }
            let cover = if blur_px < LEAST_BLUR_PX { cover } else { softened(&cover, blur_px) };
            for (i, pixel) in cover.pixels().iter().enumerate() {
                let at = (window.left + i % window.width, window.top + i / window.width);
                self.object[at] += pixel.radiance;
                self.alpha[at] = (self.alpha[at] + pixel.visible).min(1.0);
                self.occlusion[at] += pixel.hidden;
            }
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
    /// radiance minus the photo's. Returns what is added to the objects.
    pub fn clear_edge(&mut self, pixel: (usize, usize), change: Vec3) -> Vec3 {
        let added = if self.alpha[pixel] > 0.0 { change * self.occlusion[pixel] } else { Vec3::ZERO };
        self.object[pixel] += added;
        added
    }
}

/// Blur that is not visible, pixels.
const LEAST_BLUR_PX: f32 = 0.25;

/// Pixels that an object reaches.
struct Window {
    left: usize,
    top: usize,
    width: usize,
    height: usize,
}

impl Window {
    /// Returns the pixels within the reach of a blur; `None` around none.
    fn around(pixels: impl Iterator<Item = (usize, usize)>, blur_px: f32, size: [usize; 2]) -> Option<Self> {
        let reach = (3.0 * blur_px).ceil() as usize;
        let bounds = pixels.fold(None, |bounds: Option<[usize; 4]>, (x, y)| {
            let [left, top, right, bottom] = bounds.unwrap_or([x, y, x, y]);
            Some([left.min(x), top.min(y), right.max(x), bottom.max(y)])
        });
        let [left, top, right, bottom] = bounds?;
        let (left, top) = (left.saturating_sub(reach), top.saturating_sub(reach));
        let (right, bottom) = ((right + reach + 1).min(size[0]), (bottom + reach + 1).min(size[1]));
        Some(Self { left, top, width: right - left, height: bottom - top })
    }

    fn inside(&self, (x, y): (usize, usize)) -> (usize, usize) {
        (x - self.left, y - self.top)
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
    /// `reflection`, `grain` and those of [`Passes`] if present.
    pub fn channels(&self) -> Vec<ChannelGroup> {
        let groups = [
            ChannelGroup::rgb("object", &self.object),
            ChannelGroup::single("object", "A", &self.alpha),
            ChannelGroup::rgb("shadow_ratio", &self.shadow_ratio),
            ChannelGroup::single("occlusion", "A", &self.occlusion),
        ];
        let reflection = self.reflection.as_ref().map(|reflection| ChannelGroup::rgb("reflection", reflection));
        let grain = self.grain.as_ref().map(|grain| ChannelGroup::rgb("grain", grain));
        let passes = self.passes.iter().flat_map(|passes| passes.channels());
        groups.into_iter().chain(reflection).chain(grain).chain(passes).collect()
    }

    /// Returns the text attributes of an OpenEXR file with these layers: names and values.
    pub fn metadata(&self) -> Vec<(String, String)> {
        self.passes.iter().flat_map(|passes| passes.metadata()).collect()
    }

    pub(crate) fn new(
        photo: &Photo,
        exposure: f32,
        layers: Layers,
        shadow_ratio: RadianceImage,
        reflection: Option<RadianceImage>,
        grain: Option<&Grain>,
    ) -> Self {
        let reflected = |i: usize| reflection.as_ref().map_or(Vec3::ZERO, |image| Vec3::from(image.pixels()[i]));
        let changed = |i: usize| {
            layers.alpha.pixels()[i] > 0.0 || shadow_ratio.pixels()[i] != [1.0; 3] || reflected(i) != Vec3::ZERO
        };
        let clean = |i: usize, photo: Vec3| {
            let floor = photo * Vec3::from(shadow_ratio.pixels()[i]) + reflected(i) / exposure;
            let under = floor.max(photo.min(Vec3::ZERO)) * (1.0 - layers.alpha.pixels()[i]);
            under + layers.object.pixels()[i] / exposure
        };
        let grain = grain.map(|grain| grain_layer(photo, exposure, &layers.alpha, grain, clean));
        let blended = |i: usize, photo: Vec3| {
            let added = grain.as_ref().map_or(Vec3::ZERO, |grain| Vec3::from(grain.pixels()[i]) / exposure);
            clean(i, photo) + added
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
        Self {
            image,
            object,
            alpha: layers.alpha,
            shadow_ratio,
            reflection,
            grain,
            occlusion: layers.occlusion,
            passes: None,
        }
    }
}

/// Computes the grain of the objects in a composite without it.
fn grain_layer(
    photo: &Photo,
    exposure: f32,
    alpha: &Image<f32>,
    grain: &Grain,
    clean: impl Fn(usize, Vec3) -> Vec3 + Sync,
) -> RadianceImage {
    let width = photo.width();
    let added = |i: usize| {
        let alpha = alpha.pixels()[i];
        if alpha <= 0.0 {
            return [0.0; 3];
        }
        let at = (i % width, i / width);
        let before = match photo {
            Photo::Encoded8(photo) => photo.encoding.linear(photo.image[at]),
            photo => photo.linear_at(at),
        };
        let value = clean(i, Vec3::from(before)).to_array();
        let codes = value.map(srgb_from_linear);
        let noise = grain.at(at, codes.iter().sum::<f32>() / 3.0);
        // what is left of the photo's own noise, and this, have the variance of the photo's
        let share = (1.0 - (1.0 - alpha) * (1.0 - alpha)).sqrt();
        [0, 1, 2].map(|c| (linear_from_srgb(codes[c] + noise[c] * share) - value[c]) * exposure)
    };
    RadianceImage::new(width, photo.height(), (0..width * photo.height()).into_par_iter().map(added).collect())
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
