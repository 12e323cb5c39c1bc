//! The bytes of a picture on their way to a decoder.

use crate::{Format, ImageError};

/// Most pixels that a file may declare: 2²⁸, enough for a 16384 × 8192 panorama twice over.
pub const MAX_PIXELS: u64 = 1 << 28;

/// Names the source of bytes in errors: the decoders see bytes alone.
#[derive(Clone, Copy)]
pub(crate) struct Source<'a> {
    pub bytes: &'a [u8],
    pub name: &'a str,
    pub format: Format,
}

impl Source<'_> {
    pub fn invalid(&self, reason: impl ToString) -> ImageError {
        ImageError::Invalid { name: self.name.to_owned(), format: self.format, reason: reason.to_string() }
    }

    pub fn unsupported(&self, feature: impl ToString) -> ImageError {
        ImageError::Unsupported { name: self.name.to_owned(), format: self.format, feature: feature.to_string() }
    }

    /// Refuses sizes that are empty, beyond [`MAX_PIXELS`], or far beyond what the bytes can hold.
    ///
    /// The second rule keeps a file of a kilobyte from asking for gigabytes: deflate reaches 1032 : 1 and no other
    /// compression of a real picture comes near it, so 4 megapixels + 1100 pixels per byte leave every real file alone.
    pub fn check_size(&self, width: u64, height: u64) -> Result<(), ImageError> {
        if width == 0 || height == 0 {
            return Err(self.invalid(format!("it has no pixels ({width} × {height})")));
        }
        let pixels = width.saturating_mul(height);
        let plausible = (4 << 20) + 1100 * self.bytes.len() as u64;
        let limit = if pixels > MAX_PIXELS {
            format!("more than the limit of {} megapixels", MAX_PIXELS >> 20)
        } else if pixels > plausible {
            format!("which {} bytes cannot hold", self.bytes.len())
        } else {
            return Ok(());
        };
        Err(ImageError::TooLarge { name: self.name.to_owned(), format: self.format, width, height, limit })
    }
}
