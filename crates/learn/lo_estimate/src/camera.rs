use lo_geometry::{Camera, CameraError};
use lo_imaging::{BlackBars, Photo, PhotoFile};
use lo_scene::{CameraSource, working_photo};

use crate::Estimator;

/// Horizontal field of view assumed for a photo with no other information on its lens, in degrees.
///
/// A phone's main camera has it (about 27 mm on 35 mm film).
pub const DEFAULT_HFOV_DEG: f64 = 65.0;

impl Estimator {
    /// Determines the camera of a photo, in pixels of the photo, and reports its source.
    ///
    /// The focal length comes from EXIF, else from the networks' prediction, else from [`DEFAULT_HFOV_DEG`]. The
    /// principal point is the photo's centre, or that of the picture between black bars.
    ///
    /// # Errors
    /// If the photo has no pixels.
    pub fn camera_of(&self, photo: &PhotoFile) -> Result<(Camera, CameraSource), CameraError> {
        let of_picture = |picture: &Photo| {
            let focal = photo.focal.focal_px(picture.width() as u32, picture.height() as u32);
            match focal {
                Some(focal) => Ok((with_focal(picture, focal)?, CameraSource::Exif)),
                None => self.camera_of_picture(picture),
            }
        };
        between_bars(&photo.photo, of_picture)
    }

    /// Determines the camera of a photo without EXIF and bars.
    pub(crate) fn camera_of_picture(&self, photo: &Photo) -> Result<(Camera, CameraSource), CameraError> {
        let (width, height) = (photo.width() as u32, photo.height() as u32);
        let default = Camera::from_hfov_deg(DEFAULT_HFOV_DEG, width, height)?;
        let predicted = self.networks().and_then(|networks| networks.perspective(&working_photo(photo).srgb8(), None));
        let Some(predicted) = predicted else { return Ok((default, CameraSource::Default)) };
        let focal = 0.5 * f64::from(width.max(height)) / predicted.camera.half_extent;
        Ok((with_focal(photo, focal)?, CameraSource::Network { deviation_deg: predicted.fov_deviation_deg as f32 }))
    }
}

/// Determines the camera of a photo from the picture between its black bars.
fn between_bars(
    photo: &Photo,
    camera_of: impl FnOnce(&Photo) -> Result<(Camera, CameraSource), CameraError>,
) -> Result<(Camera, CameraSource), CameraError> {
    match BlackBars::of(photo) {
        None => camera_of(photo),
        Some(bars) => {
            let (camera, source) = camera_of(&bars.cropped(photo))?;
            Ok((bars.camera_of_photo(&camera), source))
        }
    }
}

fn with_focal(photo: &Photo, focal: f64) -> Result<Camera, CameraError> {
    let (width, height) = (photo.width() as u32, photo.height() as u32);
    Camera::new(focal, focal, 0.5 * f64::from(width), 0.5 * f64::from(height), width, height)
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use lo_imaging::{FocalLength, Image};

    #[test]
    fn exif_wins_over_the_default() {
        let photo = Photo::Srgb8(Image::new(600, 400, vec![[0; 3]; 240_000]));
        let plain = PhotoFile::new(photo);
        let (camera, source) = Estimator::without_networks().camera_of(&plain).unwrap();
        assert_eq!(source, CameraSource::Default);
        assert!((camera.hfov_deg() - DEFAULT_HFOV_DEG).abs() < 1e-9);
        // 36 mm × 24 mm film behind a 28 mm lens: 2 atan(18 / 28) = 65.47 degrees
        let film = FocalLength { equivalent_35mm: Some(28.0), ..FocalLength::default() };
        let (camera, source) = Estimator::without_networks().camera_of(&PhotoFile { focal: film, ..plain }).unwrap();
        assert_eq!(source, CameraSource::Exif);
        assert!((camera.hfov_deg() - 65.47).abs() < 0.01, "{}", camera.hfov_deg());
    }
}
