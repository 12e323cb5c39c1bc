//! Common image formats (PNG, JPEG, WebP, TIFF, BMP, PNM), decoded by the `image` crate.

use std::io::Cursor;

use image::{DynamicImage, ImageDecoder, ImageFormat, ImageReader, Limits};
use rayon::prelude::*;

use crate::color::linear_from_srgb;
use crate::encoded_image::EncodedImage;
use crate::exif::{FocalLength, PhotoExposure};
use crate::{Format, Image, ImageError, Photo, RadianceImage};

/// Returns width and height as stored, before the EXIF orientation is applied.
pub(crate) fn size(source: EncodedImage) -> Result<[u32; 2], ImageError> {
    let (width, height) = decoder(source)?.dimensions();
    Ok([width, height])
}

/// Decodes an image, applies its EXIF (or TIFF) orientation, and reads the EXIF tags of lens and exposure.
pub(crate) fn decode(source: EncodedImage) -> Result<(DynamicImage, FocalLength, PhotoExposure), ImageError> {
    let mut decoder = decoder(source)?;
    // unreadable metadata must not fail the image
    let exif = decoder.exif_metadata().ok().flatten();
    let focal = exif.as_deref().map(FocalLength::from_exif).unwrap_or_default();
    let exposure = exif.as_deref().map(PhotoExposure::from_exif).unwrap_or_default();
    let orientation = match exif.as_deref().and_then(image::metadata::Orientation::from_exif_chunk) {
        Some(orientation) => orientation,
        None => decoder.orientation().unwrap_or(image::metadata::Orientation::NoTransforms),
    };
    let mut decoded = DynamicImage::from_decoder(decoder).map_err(|e| invalid(source, e))?;
    decoded.apply_orientation(orientation);
    Ok((decoded, focal, exposure))
}

/// Creates a decoder, which reads the header, and checks the image's size.
fn decoder(source: EncodedImage<'_>) -> Result<impl ImageDecoder, ImageError> {
    let format = match source.format {
        Format::Png => ImageFormat::Png,
        Format::Jpeg => ImageFormat::Jpeg,
        Format::WebP => ImageFormat::WebP,
        Format::Tiff => ImageFormat::Tiff,
        Format::Bmp => ImageFormat::Bmp,
        Format::Pnm => ImageFormat::Pnm,
        _ => return Err(source.unsupported("expected a PNG, JPEG, WebP, TIFF, BMP or PNM image")),
    };
    let mut reader = ImageReader::with_format(Cursor::new(source.bytes), format);
    // the size is checked below; this bounds a decoder's other allocations
    let mut limits = Limits::default();
    limits.max_alloc = Some(4 << 30);
    reader.limits(limits);
    let decoder = reader.into_decoder().map_err(|e| invalid(source, e))?;
    let (width, height) = decoder.dimensions();
    source.check_size(width.into(), height.into())?;
    Ok(decoder)
}

fn invalid(source: EncodedImage, error: image::ImageError) -> ImageError {
    match error {
        image::ImageError::Unsupported(e) => source.unsupported(e),
        image::ImageError::Limits(e) => source.invalid(e),
        image::ImageError::Decoding(e) => {
            source.invalid(std::error::Error::source(&e).map_or(e.to_string(), |s| s.to_string()))
        }
        e => source.invalid(e),
    }
}

/// Converts a decoded image to a photo. 8-bit images stay as they are, deeper ones become linear light; float TIFF is
/// already linear.
///
/// Alpha is dropped, since photos have none; the colours stored beneath transparent pixels are kept.
pub(crate) fn photo(decoded: DynamicImage) -> Photo {
    let (width, height) = (decoded.width() as usize, decoded.height() as usize);
    match decoded {
        DynamicImage::ImageLuma16(_)
        | DynamicImage::ImageLumaA16(_)
        | DynamicImage::ImageRgb16(_)
        | DynamicImage::ImageRgba16(_) => {
            let table: Vec<f32> = (0..=u16::MAX).map(|v| linear_from_srgb(f32::from(v) / 65535.0)).collect();
            let samples = decoded.into_rgb16().into_raw();
            let linear = samples.as_chunks::<3>().0.par_iter().map(|p| p.map(|v| table[usize::from(v)])).collect();
            Photo::Linear(Image::new(width, height, linear))
        }
        DynamicImage::ImageRgb32F(_) | DynamicImage::ImageRgba32F(_) => {
            Photo::Linear(RadianceImage::new(width, height, pixels_of(decoded.into_rgb32f().into_raw())))
        }
        _ => Photo::Srgb8(Image::new(width, height, pixels_of(decoded.into_rgb8().into_raw()))),
    }
}

pub(crate) fn rgba8(decoded: DynamicImage) -> Image<[u8; 4]> {
    let (width, height) = (decoded.width() as usize, decoded.height() as usize);
    Image::new(width, height, pixels_of(decoded.into_rgba8().into_raw()))
}

/// Groups samples into pixels, without a copy if possible: a photo of 50 megapixels has 150 MB.
fn pixels_of<T: bytemuck::Pod, const N: usize>(samples: Vec<T>) -> Vec<[T; N]>
where
    [T; N]: bytemuck::Pod,
{
    bytemuck::try_cast_vec(samples).unwrap_or_else(|(_, samples)| samples.as_chunks::<N>().0.to_vec())
}
