use lo_geometry::Quat;
use lo_imaging::RadianceImage;

use crate::PanoramaImage;

/// Expected light at the camera: an arithmetic mean of the possible radiance.
///
/// Lamps and windows of uncertain position are spread out in it. The octree of a scene holds the likeliest radiance
/// instead, in which they vanish.
#[derive(Clone, Debug, PartialEq)]
pub struct ExpectedLight {
    /// Expected radiance around the camera, in the photo's units.
    pub image: PanoramaImage,
    /// Expected log₂ of the largest ÷ smallest irradiance over normals at the camera.
    pub contrast_stops: f32,
}

/// Valid contrasts, stops.
const CONTRASTS: std::ops::RangeInclusive<f32> = 0.0..=16.0;

impl ExpectedLight {
    /// Creates it from a panorama of linear radiance and the rotation from its axes to the photo's. The contrast is
    /// clamped to 0 to 16 stops.
    pub fn new(radiance: &RadianceImage, world_from_panorama: Quat, contrast_stops: f32) -> Self {
        let image = PanoramaImage::new(radiance, world_from_panorama);
        Self { image, contrast_stops: contrast_stops.clamp(*CONTRASTS.start(), *CONTRASTS.end()) }
    }

    /// Returns whether a contrast is in range.
    pub(crate) fn is_contrast(contrast_stops: f32) -> bool {
        CONTRASTS.contains(&contrast_stops)
    }
}
