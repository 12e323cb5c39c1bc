use geometry::{Camera, Quat, Vec3};
use imaging::{DepthMap, Image, RadianceImage};
use octree::RadiancePoint;

/// One photo with everything that is known about its room (SPEC §8). What a source does not have is `None` or empty.
///
/// All positions and directions are in the photo's frame: the camera at the origin looks along −Z, +Y is up in the
/// picture, metres. Radiance is in units of the photo's white.
#[derive(Clone, Debug)]
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
    /// Depth as a sensor measures it.
    pub sensor_depth_m: Option<DepthMap>,
    /// Unit normals in the camera's axes, towards the camera; 0 where there is no surface.
    pub normal: Option<Image<[f32; 3]>>,
    /// Base colour.
    pub albedo: Option<Image<[f32; 3]>>,
    /// Radiance leaving all surfaces of the room, seen or not: what the octree is built from.
    pub points: Vec<RadiancePoint>,
    /// Panoramas at other places.
    pub views: Vec<NovelView>,
}

/// An HDR panorama at a known place.
#[derive(Clone, Debug)]
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
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Split {
    /// Nine scenes of ten.
    Train,
    /// One scene of ten.
    Validation,
}

impl Split {
    /// The part that a scene belongs to: a matter of its id alone, so that it never changes.
    pub fn of(scene_id: &str) -> Self {
        if random::hash(scene_id.as_bytes()) % 10 == 0 { Self::Validation } else { Self::Train }
    }
}
