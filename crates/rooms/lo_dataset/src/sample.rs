use lo_geometry::{Camera, Quat, Vec3};
use lo_imaging::{DepthMap, Image, RadianceImage};
use lo_octree::RadiancePoint;
use serde::{Deserialize, Serialize};

/// What a source says beyond a sample's own fields: settings of the camera, properties of the scene, names of files.
pub type Metadata = serde_json::Map<String, serde_json::Value>;

/// One photo with everything that is known about its room (`docs/method.md` §8). What a source does not have is `None` or empty.
///
/// All positions and directions are in the photo's frame: the camera at the origin looks along −Z, +Y is up in the
/// picture, metres. Radiance is in units of the photo's white.
#[derive(Clone, Debug, PartialEq)]
pub struct Sample {
    /// Unique in its dataset.
    pub id: String,
    /// All samples of one room share it; the split is made by it.
    pub scene_id: String,
    /// The photo, sRGB.
    pub photo: Image<[u8; 3]>,
    /// Its camera.
    pub camera: Camera,
    /// Unit direction that points up in the room.
    pub up: Option<Vec3>,
    /// The light that made the photo.
    pub radiance: Option<RadianceImage>,
    /// True depth along the optical axis.
    pub depth_m: Option<DepthMap>,
    /// Depth as a sensor measures it; the same field of view, but not always as many pixels.
    pub sensor_depth_m: Option<DepthMap>,
    /// Unit normals in the camera's axes, towards the camera; 0 where there is no surface.
    pub normal: Option<Image<[f32; 3]>>,
    /// Base colour.
    pub albedo: Option<Image<[f32; 3]>>,
    /// Radiance leaving all surfaces of the room, seen or not: what the octree is built from.
    pub points: Vec<RadiancePoint>,
    /// Surface that each point stands for, where they are known to lie evenly on all surfaces.
    pub point_area_m2: Option<f32>,
    /// Panoramas at other places.
    pub views: Vec<NovelView>,
    /// What else the source says.
    pub metadata: Metadata,
}

/// An HDR panorama at a known place.
#[derive(Clone, Debug, PartialEq)]
pub struct NovelView {
    /// Position in the photo's frame, metres.
    pub position_m: Vec3,
    /// Photo-frame direction = rotation · panorama direction.
    pub rotation: Quat,
    /// Equirectangular radiance, in units of the photo's white.
    pub radiance: RadianceImage,
    /// Distance from the position.
    pub depth_m: Option<DepthMap>,
}

/// Part of a dataset.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Split {
    /// Nine scenes of ten.
    Train,
    /// One scene of ten.
    Validation,
}

impl Split {
    /// The part that a scene belongs to: a matter of its id alone, so that it never changes.
    pub fn of(scene_id: &str) -> Self {
        if lo_random::hash(scene_id.as_bytes()).is_multiple_of(10) { Self::Validation } else { Self::Train }
    }
}

#[cfg(test)]
pub(crate) mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    /// A sample of two by two pixels with nothing but its photo.
    pub(crate) fn sample() -> Sample {
        Sample {
            id: "sample".to_owned(),
            scene_id: "scene".to_owned(),
            photo: Image::new(2, 2, vec![[10, 20, 30]; 4]),
            camera: Camera::from_hfov_deg(60.0, 2, 2).unwrap(),
            up: None,
            radiance: None,
            depth_m: None,
            sensor_depth_m: None,
            normal: None,
            albedo: None,
            points: Vec::new(),
            point_area_m2: None,
            views: Vec::new(),
            metadata: Metadata::new(),
        }
    }

    #[test]
    fn one_scene_of_ten_is_for_validation_and_stays_there() {
        let validation = |id: &str| Split::of(id) == Split::Validation;
        let count = (0..10_000).filter(|i| validation(&format!("s0-{i:06}"))).count();
        // binomial: 1000 ± 30
        assert!((900..1100).contains(&count), "{count}");
        // these never change: a changed split would let validation rooms into training
        let first: Vec<usize> = (0..40).filter(|i| validation(&format!("s0-{i:06}"))).collect();
        assert_eq!(first, [7, 10, 36]);
    }
}
