use image::DynamicImage;

use crate::source_color::SourceColor;
use crate::{GainMap, PhotoNote};

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

/// Returns the colour space that a file states; sRGB, with a note, if it is unusable.
pub(crate) fn usable_color(stated: Result<SourceColor, &'static str>, notes: &mut Vec<PhotoNote>) -> SourceColor {
    stated.unwrap_or_else(|reason| {
        notes.push(PhotoNote::UnusableProfile { reason });
        SourceColor::Srgb
    })
}

/// Returns the gain map of a file; none, with a note, if it is unusable.
pub(crate) fn usable_gain_map(
    stated: Option<Result<GainMap, &'static str>>,
    notes: &mut Vec<PhotoNote>,
) -> Option<GainMap> {
    stated?.map_err(|reason| notes.push(PhotoNote::UnusableGainMap { reason })).ok()
}
