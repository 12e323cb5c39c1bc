//! Colour profile, EXIF and XMP in encoded photos.

use image::ImageEncoder;
use image::error::ImageResult;

use crate::generator::{insert_chunk, insert_segment};
use crate::{ColorProfile, PhotoEncoding};

/// Longest payload of a JPEG segment that is written, bytes.
pub(crate) const MAX_SEGMENT: usize = 65_000;

/// Name of the XMP segment of a JPEG (Adobe XMP specification, part 3, 1.1.3).
const XMP_SEGMENT: &[u8] = b"http://ns.adobe.com/xap/1.0/\0";

/// Keyword and empty fields of the iTXt chunk with XMP (Adobe XMP specification, part 3, 1.1.5).
const XMP_CHUNK: &[u8] = b"XML:com.adobe.xmp\0\0\0\0\0";

/// Profile and metadata of a photo to be encoded; by default none.
#[derive(Clone, Copy, Default)]
pub(crate) struct PhotoTags<'a> {
    icc: &'a [u8],
    exif: &'a [u8],
    xmp: &'a [u8],
}

impl<'a> PhotoTags<'a> {
    pub fn of(encoding: &'a PhotoEncoding) -> Self {
        let icc = encoding.profile.as_ref().map_or(&[][..], ColorProfile::icc);
        Self { icc, exif: &encoding.exif, xmp: &encoding.xmp }
    }

    /// Passes profile and EXIF to an encoder. EXIF longer than `most` bytes is left out.
    pub fn on<E: ImageEncoder>(&self, mut encoder: E, most: usize) -> ImageResult<E> {
        if !self.icc.is_empty() {
            encoder.set_icc_profile(self.icc.to_vec()).map_err(image::ImageError::Unsupported)?;
        }
        if !self.exif.is_empty() && self.exif.len() <= most {
            encoder.set_exif_metadata(self.exif.to_vec()).map_err(image::ImageError::Unsupported)?;
        }
        Ok(encoder)
    }

    pub fn add_xmp_to_png(&self, png: &mut Vec<u8>) {
        if !self.xmp.is_empty() {
            insert_chunk(png, *b"iTXt", &[XMP_CHUNK, self.xmp].concat());
        }
    }

    /// Adds XMP of at most one segment; extended XMP is left out.
    pub fn add_xmp_to_jpeg(&self, jpeg: &mut Vec<u8>) {
        if !self.xmp.is_empty() && self.xmp.len() <= MAX_SEGMENT {
            insert_segment(jpeg, 0xe1, &[XMP_SEGMENT, self.xmp].concat());
        }
    }
}
