use rayon::prelude::*;

use crate::color::linear_from_srgb8;
use crate::{Image, RadianceImage};

/// The pixels of a photo as stored: 8-bit images stay 8-bit, so that unchanged pixels can be written back exactly.
#[derive(Clone, Debug, PartialEq)]
pub enum Photo {
    /// 8-bit sRGB (IEC 61966-2-1), EXIF orientation applied.
    Srgb8(Image<[u8; 3]>),
    /// Linear Rec. 709 radiance, from 16-bit or HDR files.
    Linear(RadianceImage),
}

impl Photo {
    /// Width in pixels.
    pub fn width(&self) -> usize {
        match self {
            Self::Srgb8(image) => image.width(),
            Self::Linear(image) => image.width(),
        }
    }

    /// Height in pixels.
    pub fn height(&self) -> usize {
        match self {
            Self::Srgb8(image) => image.height(),
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
            Self::Linear(image) => image[pixel],
        }
    }

    /// Converts the photo to linear radiance; 1.0 is sRGB 255.
    pub fn radiance(&self) -> RadianceImage {
        match self {
            Self::Srgb8(image) => radiance_from_srgb8(image),
            Self::Linear(image) => image.clone(),
        }
    }

    /// Like [`Photo::radiance`], without a copy if the photo is already linear.
    pub fn into_radiance(self) -> RadianceImage {
        match self {
            Self::Srgb8(image) => radiance_from_srgb8(&image),
            Self::Linear(image) => image,
        }
    }
}

fn radiance_from_srgb8(image: &Image<[u8; 3]>) -> RadianceImage {
    let pixels = image.pixels().par_iter().map(|p| p.map(linear_from_srgb8)).collect();
    RadianceImage::new(image.width(), image.height(), pixels)
}
