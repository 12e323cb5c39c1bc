use image::DynamicImage;

use crate::GainMap;
use crate::source_color::SourceColor;

/// A photo as its file states it.
pub(crate) struct StoredPhoto {
    /// The pixels, upright.
    pub pixels: DynamicImage,
    /// Their meaning.
    pub color: SourceColor,
    /// EXIF block.
    pub exif: Option<Vec<u8>>,
    /// XMP packet.
    pub xmp: Option<Vec<u8>>,
    /// Gain map, upright.
    pub gain_map: Option<GainMap>,
}
