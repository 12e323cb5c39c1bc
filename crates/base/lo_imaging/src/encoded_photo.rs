use std::sync::Arc;

use rayon::prelude::*;

use crate::color::{linear_from_srgb8, srgb8_from_linear};
use crate::{ColorProfile, GainMap, Image, RadianceImage};

/// An 8-bit photo with its file's colour profile, gain map and metadata.
#[derive(Clone, Debug, PartialEq)]
pub struct EncodedPhoto {
    /// The pixels as stored, upright.
    pub image: Image<[u8; 3]>,
    /// Their meaning, and what a composite keeps.
    pub encoding: Arc<PhotoEncoding>,
}

/// The meaning of a photo's 8-bit values, and metadata that its composites keep.
#[derive(Debug, Default, PartialEq)]
pub struct PhotoEncoding {
    /// Colour space; `None` for sRGB.
    pub profile: Option<ColorProfile>,
    /// Radiance of clipped pixels.
    pub gain_map: Option<GainMap>,
    /// EXIF block (a TIFF structure) with upright orientation; empty if there is none.
    pub exif: Vec<u8>,
    /// XMP packet; empty if there is none.
    pub xmp: Vec<u8>,
}

impl PhotoEncoding {
    /// Whether the photo is plain sRGB without metadata.
    pub fn is_plain(&self) -> bool {
        *self == Self::default()
    }

    /// Returns the same encoding with another gain map, or none.
    pub fn with_gain_map(&self, gain_map: Option<GainMap>) -> Self {
        Self { profile: self.profile.clone(), gain_map, exif: self.exif.clone(), xmp: self.xmp.clone() }
    }

    /// Converts a pixel to linear Rec. 709. Colours outside its gamut have negative values or values above 1.
    #[inline]
    pub fn linear(&self, pixel: [u8; 3]) -> [f32; 3] {
        match &self.profile {
            None => pixel.map(linear_from_srgb8),
            Some(profile) => profile.linear(pixel),
        }
    }

    /// Returns the nearest stored pixel to linear Rec. 709: the inverse of [`PhotoEncoding::linear`].
    #[inline]
    pub fn code(&self, linear: [f32; 3]) -> [u8; 3] {
        match &self.profile {
            None => linear.map(srgb8_from_linear),
            Some(profile) => profile.code(linear),
        }
    }
}

impl EncodedPhoto {
    /// Returns the linear radiance of a pixel in Rec. 709's gamut; above 1 only by the gain map.
    #[inline]
    pub fn linear_at(&self, (x, y): (usize, usize)) -> [f32; 3] {
        self.radiance_of(self.image[(x, y)], y * self.image.width() + x)
    }

    /// Like [`EncodedPhoto::linear_at`], given a pixel's value and index.
    #[inline]
    pub fn radiance_of(&self, pixel: [u8; 3], index: usize) -> [f32; 3] {
        let linear = self.encoding.linear(pixel).map(|v| v.clamp(0.0, 1.0));
        match &self.encoding.gain_map {
            None => linear,
            Some(map) => {
                let (width, height) = (self.image.width(), self.image.height());
                let unit = |at: usize, size: usize| (at as f32 + 0.5) / size as f32;
                map.radiance(linear, [unit(index % width, width), unit(index / width, height)])
            }
        }
    }

    /// Converts the photo to linear radiance.
    pub fn radiance(&self) -> RadianceImage {
        let pixels = self.image.pixels().par_iter().enumerate().map(|(i, &pixel)| self.radiance_of(pixel, i));
        RadianceImage::new(self.image.width(), self.image.height(), pixels.collect())
    }

    /// Converts the photo to 8-bit sRGB as it is shown, without the gain map.
    pub fn srgb8(&self) -> Image<[u8; 3]> {
        if self.encoding.profile.as_ref().is_none_or(ColorProfile::is_srgb) {
            return self.image.clone();
        }
        let convert = |pixel: &[u8; 3]| self.encoding.linear(*pixel).map(srgb8_from_linear);
        let pixels = self.image.pixels().par_iter().map(convert).collect();
        Image::new(self.image.width(), self.image.height(), pixels)
    }
}
