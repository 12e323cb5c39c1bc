//! Encoded bytes of an image: input of the decoders.

use crate::{Format, ImageError};

/// Largest number of pixels that an image file may declare: 2²⁸, twice a 16384 × 8192 panorama.
pub const MAX_PIXELS: u64 = 1 << 28;

/// Bytes of an image file, with its name and format for error messages.
#[derive(Clone, Copy)]
pub(crate) struct EncodedImage<'a> {
    pub bytes: &'a [u8],
    pub name: &'a str,
    pub format: Format,
}

impl EncodedImage<'_> {
    pub fn invalid(&self, reason: impl ToString) -> ImageError {
        ImageError::Invalid { name: self.name.to_owned(), format: self.format, reason: reason.to_string() }
    }

    pub fn unsupported(&self, feature: impl ToString) -> ImageError {
        ImageError::Unsupported { name: self.name.to_owned(), format: self.format, feature: feature.to_string() }
    }

    /// Rejects sizes that are empty, beyond [`MAX_PIXELS`], or implausible for the number of bytes.
    ///
    /// The last rule keeps a small file from allocating gigabytes. Deflate reaches 1032 : 1, and no other compression
    /// of a real image comes near it, so a limit of 4 megapixels + 1100 pixels per byte admits every real file. Beyond
    /// 64 megapixels, where a 16-bit photo takes gigabytes, it is 64 pixels per byte; photos have 20 at most.
    ///
    /// # Errors
    /// [`ImageError::Invalid`] for an empty image, [`ImageError::TooLarge`] otherwise.
    pub fn check_size(&self, width: u64, height: u64) -> Result<(), ImageError> {
        if width == 0 || height == 0 {
            return Err(self.invalid(format!("the image has no pixels ({width} × {height})")));
        }
        let pixels = width.saturating_mul(height);
        let bytes = self.bytes.len() as u64;
        let plausible = ((4 << 20) + 1100 * bytes).min((64 << 20) + 64 * bytes);
        let limit = if pixels > MAX_PIXELS {
            format!("the limit is {} megapixels", MAX_PIXELS >> 20)
        } else if pixels > plausible {
            format!("the file has only {} bytes", self.bytes.len())
        } else {
            return Ok(());
        };
        Err(ImageError::TooLarge { name: self.name.to_owned(), format: self.format, width, height, limit })
    }
}
