//! Decoders of PNG, JPEG, WebP, TIFF, BMP, GIF and PNM, with checked sizes.

use std::io::Cursor;

use image::metadata::Orientation;
use image::{DynamicImage, ImageDecoder, ImageFormat, ImageReader, Limits};

use crate::encoded_image::EncodedImage;
use crate::{Format, ImageError};

/// Most that a PNG decoder allocates beside the pixels, bytes: compressed profiles and texts.
const PNG_BYTES: u64 = 64 << 20;

/// Most that other decoders allocate, bytes; the size of the image is checked before.
const DECODER_BYTES: u64 = 4 << 30;

/// Creates a decoder, which reads the header, and checks the image's size.
pub(crate) fn decoder(source: EncodedImage<'_>) -> Result<impl ImageDecoder, ImageError> {
    let format = match source.format {
        Format::Png => ImageFormat::Png,
        Format::Jpeg => ImageFormat::Jpeg,
        Format::WebP => ImageFormat::WebP,
        Format::Tiff => ImageFormat::Tiff,
        Format::Bmp => ImageFormat::Bmp,
        Format::Gif => ImageFormat::Gif,
        Format::Pnm => ImageFormat::Pnm,
        _ => return Err(source.unsupported("expected a PNG, JPEG, WebP, TIFF, BMP, GIF or PNM image")),
    };
    let mut reader = ImageReader::with_format(Cursor::new(source.bytes), format);
    // the size is checked below; this bounds a decoder's other allocations
    let mut limits = Limits::default();
    limits.max_alloc = Some(if format == ImageFormat::Png { PNG_BYTES } else { DECODER_BYTES });
    reader.limits(limits);
    let decoder = reader.into_decoder().map_err(|e| invalid(source, e))?;
    let (width, height) = decoder.dimensions();
    source.check_size(width.into(), height.into())?;
    Ok(decoder)
}

/// Returns width and height as stored, before the EXIF orientation is applied.
pub(crate) fn size(source: EncodedImage) -> Result<[u32; 2], ImageError> {
    let (width, height) = decoder(source)?.dimensions();
    Ok([width, height])
}

/// Decodes samples as stored, upright.
pub(crate) fn samples(source: EncodedImage) -> Result<DynamicImage, ImageError> {
    let mut decoder = decoder(source)?;
    let exif = decoder.exif_metadata().ok().flatten();
    let orientation = orientation(&mut decoder, exif.as_deref());
    let mut decoded = DynamicImage::from_decoder(decoder).map_err(|e| invalid(source, e))?;
    decoded.apply_orientation(orientation);
    Ok(decoded)
}

/// Returns the orientation by EXIF, else by the decoder (TIFF).
pub(crate) fn orientation(decoder: &mut impl ImageDecoder, exif: Option<&[u8]>) -> Orientation {
    let by_exif = exif.and_then(Orientation::from_exif_chunk);
    by_exif.or_else(|| decoder.orientation().ok()).unwrap_or(Orientation::NoTransforms)
}

/// Converts a decoder's error.
pub(crate) fn invalid(source: EncodedImage, error: image::ImageError) -> ImageError {
    match error {
        image::ImageError::Unsupported(e) => source.unsupported(e),
        image::ImageError::Limits(e) => source.invalid(e),
        image::ImageError::Decoding(e) => {
            source.invalid(std::error::Error::source(&e).map_or(e.to_string(), |s| s.to_string()))
        }
        e => source.invalid(e),
    }
}
