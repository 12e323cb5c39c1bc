use std::fmt;

use lo_geometry::{Camera, CameraError};
use lo_imaging::PhotoFile;

/// Horizontal field of view of a photo about which nothing is known, in degrees: a phone's main camera (about 27 mm on 35 mm film).
pub const DEFAULT_HFOV_DEG: f64 = 65.0;

/// Where the intrinsics of a camera come from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CameraSource {
    /// The photo's EXIF block states the focal length.
    Exif,
    /// A depth model told the field of view from the photo.
    DepthModel,
    /// Nothing is known; [`DEFAULT_HFOV_DEG`] is assumed.
    Default,
}

impl fmt::Display for CameraSource {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Exif => f.write_str("focal length from EXIF"),
            Self::DepthModel => {
                f.write_str("told by the depth model; give --intrinsics or --hfov-deg if you know better")
            }
            Self::Default => f.write_str(
                "assumed: the photo has no EXIF focal length; give --intrinsics or --hfov-deg if you know better",
            ),
        }
    }
}

/// The camera that a photo's own file tells of: EXIF focal length, else the default field of view; principal point in the middle.
///
/// # Errors
/// A photo without pixels.
pub fn camera_of_photo(photo: &PhotoFile) -> Result<(Camera, CameraSource), CameraError> {
    let (width, height) = (photo.photo.width() as u32, photo.photo.height() as u32);
    if let Some(focal) = photo.focal_px() {
        let camera = Camera::new(focal, focal, 0.5 * f64::from(width), 0.5 * f64::from(height), width, height)?;
        return Ok((camera, CameraSource::Exif));
    }
    Ok((Camera::from_hfov_deg(DEFAULT_HFOV_DEG, width, height)?, CameraSource::Default))
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use lo_imaging::{FocalLength, Image, Photo, ShotExposure};

    #[test]
    fn exif_wins_over_the_default() {
        let photo = Photo::Srgb8(Image::new(600, 400, vec![[0; 3]; 240_000]));
        let plain = PhotoFile { photo, focal: FocalLength::default(), exposure: ShotExposure::default() };
        let (camera, source) = camera_of_photo(&plain).unwrap();
        assert_eq!(source, CameraSource::Default);
        assert!((camera.hfov_deg() - DEFAULT_HFOV_DEG).abs() < 1e-9);
        // 36 mm × 24 mm film behind a 28 mm lens: 2 atan(18 / 28) = 65.47 degrees
        let film = FocalLength { equivalent_35mm: Some(28.0), ..FocalLength::default() };
        let (camera, source) = camera_of_photo(&PhotoFile { focal: film, ..plain }).unwrap();
        assert_eq!(source, CameraSource::Exif);
        assert!((camera.hfov_deg() - 65.47).abs() < 0.01, "{}", camera.hfov_deg());
    }
}
