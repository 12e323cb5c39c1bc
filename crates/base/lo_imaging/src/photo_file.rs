use crate::exif::{FocalLength, PhotoExposure};
use crate::{PartialPanorama, Photo, PhotoNote};

/// A photo with its file's metadata on lens and exposure.
#[derive(Clone, Debug, PartialEq)]
pub struct PhotoFile {
    /// The pixels, upright.
    pub photo: Photo,
    /// Lens tags, as far as EXIF has them.
    pub focal: FocalLength,
    /// Exposure tags, as far as EXIF has them.
    pub exposure: PhotoExposure,
    /// Observations about the file, for the user.
    pub notes: Vec<PhotoNote>,
    /// Place on the sphere, if the picture is an equirectangular panorama by its metadata.
    pub panorama: Option<PartialPanorama>,
}

impl PhotoFile {
    /// Wraps a photo without metadata.
    pub fn new(photo: Photo) -> Self {
        Self {
            photo,
            focal: FocalLength::default(),
            exposure: PhotoExposure::default(),
            notes: Vec::new(),
            panorama: None,
        }
    }

    /// Focal length in pixels of this photo, as in [`FocalLength::focal_px`]. The photo is upright; pixels are square.
    pub fn focal_px(&self) -> Option<f64> {
        self.focal.focal_px(self.photo.width() as u32, self.photo.height() as u32)
    }

    /// Horizontal field of view of this photo in degrees, as in [`FocalLength::hfov_deg`].
    pub fn hfov_deg(&self) -> Option<f64> {
        self.focal.hfov_deg(self.photo.width() as u32, self.photo.height() as u32)
    }
}
