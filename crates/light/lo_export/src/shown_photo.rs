use lo_imaging::{Image, Photo};
use lo_scene::Frame;

/// Returns the photo with its exposure, as screens show it.
pub(crate) fn shown_photo(frame: &Frame) -> Image<[u8; 3]> {
    if frame.exposure == 1.0 { frame.photo.srgb8() } else { Photo::Linear(frame.radiance()).into_srgb8() }
}
