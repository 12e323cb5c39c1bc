use lo_geometry::Quat;
use lo_imaging::RadianceImage;

use crate::PanoramaPicture;

/// The energy of the light that is expected at the camera: an arithmetic mean over what may be there, in which lamps and windows of uncertain place are
/// spread out. The octree of a scene holds the likeliest radiance instead, in which they vanish.
#[derive(Clone, Debug, PartialEq)]
pub struct ExpectedLight {
    /// The expected radiance around the camera, in the photo's units.
    pub picture: PanoramaPicture,
    /// Expected log2 of the largest over the smallest irradiance of a matte sphere at the camera.
    pub contrast_stops: f32,
}

/// Contrasts of rooms, stops.
const CONTRASTS: std::ops::RangeInclusive<f32> = 0.0..=16.0;

impl ExpectedLight {
    /// From a panorama of linear radiance and the rotation from its axes to the photo's; the contrast is limited to 0 to 16 stops.
    pub fn new(radiance: &RadianceImage, world_from_panorama: Quat, contrast_stops: f32) -> Self {
        let picture = PanoramaPicture::new(radiance, world_from_panorama);
        Self { picture, contrast_stops: contrast_stops.clamp(*CONTRASTS.start(), *CONTRASTS.end()) }
    }

    /// Whether a file may say so.
    pub(crate) fn is_contrast(contrast_stops: f32) -> bool {
        CONTRASTS.contains(&contrast_stops)
    }
}
