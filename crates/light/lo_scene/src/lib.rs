//! The scene: a lighting octree together with the photo, depth and camera that object insertion needs, and its file.
//!
//! # The scene file
//!
//! One `.safetensors` file, self-contained. Tensors (little-endian):
//!
//! | tensor | type, shape | |
//! | --- | --- | --- |
//! | `photo` | U8 `[height, width, 3]` | sRGB, as the photo came, EXIF orientation applied |
//! | | or F32 `[height, width, 3]` | linear Rec. 709, where the photo had more than 8 bits |
//! | `depth_m` | F32 `[h, w]` | depth along the optical axis, same field of view, 0 = no reading |
//! | `octree.d.…` | | the lighting octree, depth by depth: see [`lo_octree::write_tensors`] |
//! | `confidence` | U8 `[rows]` | only where a network completed the scene: of each feature row of the octree, depth by depth, 255 = sure |
//! | `panorama` | F16 `[h, 2 h, 3]` | only where a panorama of the room was given: its linear radiance divided by the `scale` of `panorama_picture` |
//! | `expected_light` | F16 `[h, 2 h, 3]` | only where a network expects light: its linear radiance around the camera divided by the `scale` of `expected_light` |
//! | `panorama_share` | U8 `[rows]` | only where a panorama of the room was given: how much of each row it gave, 255 = all |
//! | `objects` | U8 `[bytes]` | only where objects stand in the photo: their layout, JSON as `insert --layout` reads it |
//! | `objects.0` … | U8 `[bytes]` | only beside it: the files of their meshes as they came |
//!
//! Under the key `lightoctree` of safetensors' `__metadata__` lies one JSON block: `format_version` (1), `program`,
//! `octree` (`format_version`, `depth`, `full_depth`, `cube` with `origin_m` and `edge_m`), `camera` (`fx fy cx cy width height`, pixels of the photo),
//! `exposure`, `completion` (`network`, `shell`, `none`), `room` (null, or `up` and `planes`: `side`, `plane` with `normal` and
//! `offset_m`, `measured`), `sources` (file names without folders), `predicted_depth` (whether `depth_m` was predicted from the photo),
//! `depth_model` (name of the depth model that did, only where it is not the program's own) and `confidence` (whether there is a tensor of that name). Where it is known, `camera_source` says where the camera comes from (`from`: `exif`,
//! `depth-model`, `default`, or `network` with `deviation_deg`), and where a network told which way is up, `up_deviation_deg` how far off that is expected to be. Where a panorama
//! was given there is also `panorama`: `file`, `position_m`, `yaw_deg`, `pitch_deg`, `roll_deg`, `exposure_ev`, `confidence`, `clipped`
//! ([`PanoramaSource`]); of expected light `expected_light` has `scale`, `world_from_panorama` and `contrast_stops` ([`ExpectedLight`]). With a panorama comes also `panorama_picture` with `scale` (values of the tensor times it are radiance) and `world_from_panorama` (rotation `x y z w`). Where the scene is from several photos, `other_photos` has of each but the first
//! `first_from_camera` (`rotation` x y z w, `translation_m`), `camera` and `exposure`. Edits of light are in `light_edits`: `emitters`,
//! `added` and `guessed` ([`LightEdits`]); the octree's tensors remain the unedited estimate. Inserted objects are in `objects`, with `floor_gloss`, `frames` (only where
//! somebody chose their number), `fps`, `time_s` ([`ObjectsShown`]) and `files`, the names of what `objects.0` … hold ([`SceneObjects`]). In Python:
//!
//! ```python
//! from safetensors import safe_open
//! f = safe_open("room.safetensors", "numpy"); scene = __import__("json").loads(f.metadata()["lightoctree"])
//! photo, depth_m, leaves = (f.get_tensor(name) for name in ("photo", "depth_m", f"octree.{scene['octree']['depth']}.rgba"))
//! ```
//!
//! The same scene gives the same bytes. Reading checks everything and names what is wrong.

mod camera_source;
mod edited_light;
mod error;
mod expected;
mod file;
mod frame;
mod guessed_light;
mod light_edits;
mod overlap;
mod panorama;
mod placement;
mod posed_frame;
pub mod poses;
mod resample;
mod room;
mod scene_objects;
mod seen_photo;
mod surfel;

use lo_geometry::Vec3;
use lo_octree::LightOctree;

pub use camera_source::CameraSource;
pub use edited_light::{EditedLight, OctreeChange};
pub use error::{FrameError, SceneError};
pub use expected::ExpectedLight;
pub use file::FORMAT_VERSION;
pub use frame::Frame;
pub use guessed_light::{CONTRASTS, GuessedLight, LightEffect, LightMode, LightTuning, WARMTHS_EV};
pub use light_edits::{
    AddedLight, AnalyticLight, EmitterEdit, LightChange, LightColor, LightEdits, LightShape, MAX_KELVIN,
    MAX_LIGHT_EDITS, MAX_LIGHT_PLACE_M, MAX_LIGHT_RADIANCE, MAX_LIGHT_SCALE, MAX_LIGHT_SIZE_M, MAX_SUN_RADIUS_DEG,
    MIN_KELVIN, MIN_LIGHT_SIZE_M, MIN_SUN_RADIUS_DEG,
};
pub use overlap::{ExposureRatio, Overlap, overlap};
pub use panorama::{LaidPanorama, PanoramaPicture, PanoramaSource};
pub use placement::place_cube;
pub use posed_frame::{OtherPhoto, PosedFrame};
pub use resample::{resized_photo, working_photo};
pub use room::{Completion, Room, RoomPlane, Side};
pub use scene_objects::{
    MAX_FPS, MAX_FRAMES, MAX_OBJECT_FILES, MAX_OBJECT_LAYOUT, MAX_TIME_S, ObjectsShown, SceneObjects,
};
pub use seen_photo::SeenPhoto;
pub use surfel::Surfel;

/// Everything that `estimate` knows about a room; self-contained.
#[derive(Clone, Debug, PartialEq)]
pub struct Scene {
    /// Radiance of the whole room.
    pub light: LightOctree,
    /// The photo with its depth and camera.
    pub frame: Frame,
    /// How the unseen part was completed.
    pub completion: Completion,
    /// Where the camera's intrinsics come from, if anybody said so.
    pub camera_source: Option<CameraSource>,
    /// Gravity and the closing planes, where they are known.
    pub room: Option<Room>,
    /// How far off the room's up is expected to be, degrees, where a network told it.
    pub up_deviation_deg: Option<f32>,
    /// Names of the files that the scene was made from, without folders.
    pub sources: Vec<String>,
    /// Whether the frame's depth was predicted from the photo instead of measured.
    pub predicted_depth: bool,
    /// Name of the depth model that predicted it, where it is not the program's own.
    pub depth_model: Option<String>,
    /// What a network says of its own work: `confidence[d][row]` of each row of [`LightOctree::rgba`], 255 · e^−ε with the expected
    /// error ε of log(1 + radiance).
    pub confidence: Option<Vec<Vec<u8>>>,
    /// The energy of the light around the camera, where a network expects it.
    pub expected: Option<ExpectedLight>,
    /// What a panorama of the room gave, where somebody had one.
    pub panorama: Option<LaidPanorama>,
    /// Photos beside the frame's that the light comes from, too.
    pub other_photos: Vec<OtherPhoto>,
    /// What somebody wants changed of the light. [`Scene::light`] of a scene that was read is the estimate, without.
    pub light_edits: LightEdits,
    /// What somebody stood into the photo.
    pub objects: SceneObjects,
    /// What the edits made of the light, where they were carried out.
    pub edited: Option<Box<EditedLight>>,
}

impl Scene {
    /// Of measured depth, with no more light than `light` holds: nothing completed, no sources named.
    pub fn as_seen(light: LightOctree, frame: Frame) -> Self {
        Self {
            light,
            frame,
            completion: Completion::None,
            camera_source: None,
            room: None,
            up_deviation_deg: None,
            sources: Vec::new(),
            predicted_depth: false,
            depth_model: None,
            confidence: None,
            expected: None,
            panorama: None,
            other_photos: Vec::new(),
            light_edits: LightEdits::default(),
            objects: SceneObjects::default(),
            edited: None,
        }
    }

    /// Unit vector against gravity, world frame; the camera's up where no room is known.
    pub fn up(&self) -> Vec3 {
        self.room.as_ref().map_or(Vec3::Y, |room| room.up)
    }
}
