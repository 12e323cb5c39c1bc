use lo_geometry::{Camera, Quat, Vec3};
use lo_imaging::{DepthMap, Image, RadianceImage};
use lo_octree::RadiancePoint;
use serde::{Deserialize, Serialize};

/// Additional data of a sample: camera settings, scene properties, file names.
pub type Metadata = serde_json::Map<String, serde_json::Value>;

/// One photo with all data of its room (`docs/method.md` §8). Missing data is `None` or empty.
///
/// All positions and directions are in the photo's frame: the camera at the origin looks along −Z, +Y is up in the
/// image, in metres. Radiance is in units of the photo's white.
#[derive(Clone, Debug, PartialEq)]
pub struct Sample {
    /// Identifier, unique in its dataset.
    pub id: String,
    /// Room of the sample. All samples of a room share it, and it determines the split.
    pub scene_id: String,
    /// sRGB photo.
    pub photo: Image<[u8; 3]>,
    /// Camera intrinsics.
    pub camera: Camera,
    /// Unit up direction of the room.
    pub up: Option<Vec3>,
    /// HDR radiance of the photo's pixels.
    pub radiance: Option<RadianceImage>,
    /// True depth along the optical axis.
    pub depth_m: Option<DepthMap>,
    /// Depth measured by a sensor: the same field of view, but not always the same resolution.
    pub sensor_depth_m: Option<DepthMap>,
    /// Unit normals in camera axes, towards the camera. 0 where there is no surface.
    pub normal: Option<Image<[f32; 3]>>,
    /// Base colour.
    pub albedo: Option<Image<[f32; 3]>>,
    /// Radiance leaving all surfaces of the room, observed or not. The true octree is built from these points.
    pub points: Vec<RadiancePoint>,
    /// Surface area per point, if the points are known to be evenly distributed over all surfaces.
    pub point_area_m2: Option<f32>,
    /// Panoramas at probe positions.
    pub views: Vec<NovelView>,
    /// Additional data.
    pub metadata: Metadata,
}

impl Sample {
    /// Key of the metadata that is true for samples whose panoramas are clipped at white.
    pub const CLIPPED_PANORAMAS: &str = "panoramas_clipped_at_white";

    /// Whether the panoramas are clipped at white: they are no truth for radiance above it.
    pub fn has_clipped_panoramas(&self) -> bool {
        self.metadata.get(Self::CLIPPED_PANORAMAS).is_some_and(|clipped| *clipped == true)
    }
}

/// HDR panorama at a known position.
#[derive(Clone, Debug, PartialEq)]
pub struct NovelView {
    /// Position in the photo's frame, in metres.
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
    /// Nine of ten scenes.
    Train,
    /// One of ten scenes.
    Validation,
    /// Scenes that the dataset's authors set apart to report figures on. They are in neither of the others.
    Test,
}

impl Split {
    /// Key of the metadata of samples whose dataset has a published split.
    pub(crate) const KEY: &str = "split";

    /// Returns the split of a scene of a dataset without a published split. It depends only on the scene's id, so that
    /// it never changes.
    pub fn of(scene_id: &str) -> Self {
        if lo_random::hash(scene_id.as_bytes()).is_multiple_of(10) { Self::Validation } else { Self::Train }
    }
}

#[cfg(test)]
pub(crate) mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    /// A sample of two by two pixels with only a photo.
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
        // Binomial: 1000 ± 30.
        assert!((900..1100).contains(&count), "{count}");
        // These never change: a changed split would leak validation rooms into training.
        let first: Vec<usize> = (0..40).filter(|i| validation(&format!("s0-{i:06}"))).collect();
        assert_eq!(first, [7, 10, 36]);
    }
}
