use rayon::prelude::*;

use crate::color::{linear_from_srgb8, srgb8_from_linear};
use crate::{EncodedPhoto, Image, PhotoEncoding, RadianceImage};

/// The pixels of a photo as stored: 8-bit images stay 8-bit, so that unchanged pixels can be written back exactly.
#[derive(Clone, Debug, PartialEq)]
pub enum Photo {
    /// 8-bit sRGB (IEC 61966-2-1), EXIF orientation applied.
    Srgb8(Image<[u8; 3]>),
    /// 8-bit values with a colour profile, a gain map or metadata, EXIF orientation applied.
    Encoded8(EncodedPhoto),
    /// Linear Rec. 709 radiance, from 16-bit or HDR files.
    Linear(RadianceImage),
}

impl Photo {
    /// Width in pixels.
    pub fn width(&self) -> usize {
        match self {
            Self::Srgb8(image) => image.width(),
            Self::Encoded8(photo) => photo.image.width(),
            Self::Linear(image) => image.width(),
        }
    }

    /// Height in pixels.
    pub fn height(&self) -> usize {
        match self {
            Self::Srgb8(image) => image.height(),
            Self::Encoded8(photo) => photo.image.height(),
            Self::Linear(image) => image.height(),
        }
    }

    /// Returns the linear radiance of a pixel, given its column and row.
    ///
    /// # Panics
    /// If the pixel is outside the photo.
    pub fn linear_at(&self, pixel: (usize, usize)) -> [f32; 3] {
        match self {
            Self::Srgb8(image) => image[pixel].map(linear_from_srgb8),
            Self::Encoded8(photo) => photo.linear_at(pixel),
            Self::Linear(image) => image[pixel],
        }
    }

    /// Converts the photo to linear radiance; 1.0 is its white. Clipped pixels are brighter if there is a gain map.
    pub fn radiance(&self) -> RadianceImage {
        match self {
            Self::Srgb8(image) => radiance_from_srgb8(image),
            Self::Encoded8(photo) => photo.radiance(),
            Self::Linear(image) => image.clone(),
        }
    }

    /// Like [`Photo::radiance`], without a copy if the photo is already linear.
    pub fn into_radiance(self) -> RadianceImage {
        match self {
            Self::Srgb8(image) => radiance_from_srgb8(&image),
            Self::Encoded8(photo) => photo.radiance(),
            Self::Linear(image) => image,
        }
    }

    /// Converts the photo to 8-bit sRGB; values above white are clipped.
    pub fn srgb8(&self) -> Image<[u8; 3]> {
        match self {
            Self::Srgb8(image) => image.clone(),
            Self::Encoded8(photo) => photo.srgb8(),
            Self::Linear(image) => image.map(|rgb| rgb.map(srgb8_from_linear)),
        }
    }

    /// Like [`Photo::srgb8`], without a copy if the photo is 8-bit sRGB.
    pub fn into_srgb8(self) -> Image<[u8; 3]> {
        match self {
            Self::Srgb8(image) => image,
            photo => photo.srgb8(),
        }
    }

    /// Combines 8-bit pixels with their encoding.
    pub fn encoded8(image: Image<[u8; 3]>, encoding: PhotoEncoding) -> Self {
        if encoding.is_plain() {
            Self::Srgb8(image)
        } else {
            Self::Encoded8(EncodedPhoto { image, encoding: encoding.into() })
        }
    }
}

fn radiance_from_srgb8(image: &Image<[u8; 3]>) -> RadianceImage {
    let pixels = image.pixels().par_iter().map(|p| p.map(linear_from_srgb8)).collect();
    RadianceImage::new(image.width(), image.height(), pixels)
}
