//! CMYK samples as stored, which the general decoders convert to RGB without a profile.

use std::io::Cursor;

use tiff::decoder::{Decoder, DecodingResult};
use zune_jpeg::JpegDecoder;
use zune_jpeg::zune_core::bytestream::ZCursor;
use zune_jpeg::zune_core::colorspace::ColorSpace;
use zune_jpeg::zune_core::options::DecoderOptions;

use crate::encoded_image::EncodedImage;
use crate::jpeg::JpegSegments;
use crate::{Format, ImageError};

/// Returns the 8-bit CMYK samples of a JPEG or TIFF, 0 = no ink; `None` if the image is not CMYK.
///
/// JPEGs with Adobe's marker store inverted values (Adobe technical note 5116).
pub(crate) fn samples(source: EncodedImage) -> Result<Option<Vec<[u8; 4]>>, ImageError> {
    match source.format {
        Format::Jpeg => of_jpeg(source),
        Format::Tiff => of_tiff(source),
        _ => Ok(None),
    }
}

fn of_jpeg(source: EncodedImage) -> Result<Option<Vec<[u8; 4]>>, ImageError> {
    let invalid = |e: zune_jpeg::errors::DecodeErrors| source.invalid(e);
    let options = DecoderOptions::default().set_strict_mode(false).set_max_width(65535).set_max_height(65535);
    let mut decoder = JpegDecoder::new_with_options(ZCursor::new(source.bytes), options);
    decoder.decode_headers().map_err(invalid)?;
    let stored = decoder.input_colorspace();
    if !matches!(stored, Some(ColorSpace::CMYK | ColorSpace::YCCK)) {
        return Ok(None);
    }
    let raw = stored.unwrap_or(ColorSpace::CMYK);
    decoder.set_options(options.jpeg_set_out_colorspace(raw));
    let mut samples = decoder.decode().map_err(invalid)?;
    if samples.len() % 4 != 0 {
        return Err(source.unsupported("a four-colour JPEG of this kind"));
    }
    let pixels = samples.as_chunks_mut::<4>().0;
    if raw == ColorSpace::YCCK {
        pixels.iter_mut().for_each(|p| *p = cmyk_from_ycck(*p));
    }
    let inverted = JpegSegments::read(source.bytes).with_prefix(0xee, b"Adobe").next().is_some();
    if inverted {
        pixels.iter_mut().for_each(|p| *p = p.map(|v| 255 - v));
    }
    Ok(Some(pixels.to_vec()))
}

/// Converts luma and chroma of the first three channels (ITU-T T.871); the fourth stays.
fn cmyk_from_ycck([y, cb, cr, k]: [u8; 4]) -> [u8; 4] {
    let (y, cb, cr) = (f32::from(y), f32::from(cb) - 128.0, f32::from(cr) - 128.0);
    let [c, m, yellow] = [y + 1.402 * cr, y - 0.344_136 * cb - 0.714_136 * cr, y + 1.772 * cb].map(|v| (v + 0.5) as u8);
    [c, m, yellow, k]
}

fn of_tiff(source: EncodedImage) -> Result<Option<Vec<[u8; 4]>>, ImageError> {
    let invalid = |e: tiff::TiffError| source.invalid(e);
    let mut decoder = Decoder::new(Cursor::new(source.bytes)).map_err(invalid)?;
    if decoder.colortype().map_err(invalid)? != tiff::ColorType::CMYK(8) {
        return Ok(None);
    }
    let DecodingResult::U8(samples) = decoder.read_image().map_err(invalid)? else { return Ok(None) };
    Ok(Some(samples.as_chunks::<4>().0.to_vec()))
}
