//! Data model of a scene: the [`Estimate`] of a room, the [`LitScene`] that renders it, and the scene file.
//!
//! # The scene file
//!
//! One self-contained `.safetensors` file. Tensors (little-endian):
//!
//! | tensor | type, shape | |
//! | --- | --- | --- |
//! | `photo` | U8 `[height, width, 3]` | sRGB, as in the photo, EXIF orientation applied |
//! | | or F32 `[height, width, 3]` | linear Rec. 709, if the photo had more than 8 bits |
//! | `depth_m` | F32 `[h, w]` | depth along the optical axis, same field of view, 0 = no reading |
//! | `octree.d.…` | | the lighting octree, depth by depth: see [`lo_octree::write_tensors`] |
//! | `confidence` | U8 `[rows]` | only if a network completed the scene: confidence per feature row, 255 = certain |
//! | `panorama` | F16 `[h, 2 h, 3]` | only with a panorama: its linear radiance ÷ `scale` of `panorama_picture` |
//! | `expected_light` | F16 `[h, 2 h, 3]` | only if predicted: linear radiance around the camera ÷ `scale` |
//! | `panorama_share` | U8 `[rows]` | only with a panorama: its share in the radiance of each row, 255 = all |
//! | `objects` | U8 `[bytes]` | only with inserted objects: their layout, JSON as read by `insert --layout` |
//! | `objects.0` … | U8 `[bytes]` | only with `objects`: the unchanged files of their meshes |
//!
//! Rows are the octree's feature rows, depth by depth.
//!
//! The key `lightoctree` of safetensors' `__metadata__` holds one JSON block:
//!
//! - `format_version` (1) and `program`
//! - `octree`: `format_version`, `depth`, `full_depth`, `cube` with `origin_m` and `edge_m`
//! - `camera`: `fx fy cx cy width height`, pixels of the photo
//! - `exposure`
//! - `completion`: `network`, `shell` or `none`
//! - `room`: null, or `up` and `planes` (`side`, `plane` with `normal` and `offset_m`, `measured`)
//! - `sources`: file names without folders
//! - `predicted_depth`: whether `depth_m` was predicted from the photo
//! - `confidence`: whether there is a tensor of that name
//!
//! Optional fields:
//!
//! - `depth_model`: name of the third-party depth model that predicted `depth_m`
//! - `camera_source`: source of the camera (`from`: `exif`, `depth-model`, `default`, or `network` with
//!   `deviation_deg`)
//! - `up_deviation_deg`: expected error of `up`, if a network predicted it
//! - `panorama`: `file`, `position_m`, `yaw_deg`, `pitch_deg`, `roll_deg`, `exposure_ev`, `confidence`, `clipped`
//!   ([`PanoramaSource`])
//! - `panorama_picture`: `scale` (radiance = value · scale) and `world_from_panorama` (rotation `x y z w`)
//! - `expected_light`: `scale`, `world_from_panorama` and `contrast_stops` ([`ExpectedLight`])
//! - `other_photos`: for each photo but the first, `first_from_camera` (`rotation` x y z w, `translation_m`), `camera`
//!   and `exposure`
//! - `light_edits`: `emitters`, `added` and `guessed` ([`LightEdits`]); the octree's tensors remain the unedited
//!   estimate
//! - `objects`: `floor_gloss`, `frames` (only if the user chose it), `fps`, `time_s` ([`ObjectDisplay`]) and `files`,
//!   the names of the contents of `objects.0` … ([`SceneObjects`])
//!
//! In Python:
//!
//! ```python
//! from safetensors import safe_open
//! f = safe_open("room.safetensors", "numpy"); scene = __import__("json").loads(f.metadata()["lightoctree"])
//! names = ("photo", "depth_m", f"octree.{scene['octree']['depth']}.rgba")
//! photo, depth_m, leaves = (f.get_tensor(name) for name in names)
//! ```
//!
//! Writing is deterministic. Reading validates everything and names what is invalid.

mod camera_source;
mod derived;
mod distorted_photo;
mod document_file;
mod document_tensors;
mod edited_light;
mod error;
mod estimate;
mod expected;
mod frame;
mod inferred_light;
mod light_edits;
mod lit_scene;
mod observed_photo;
mod overlap;
mod panorama;
mod photo_encoding_file;
mod placement;
mod plain_name;
mod posed_frame;
pub mod poses;
mod resample;
mod room;
mod scaling;
mod scene_objects;
mod surfel;
mod undistortion;

pub use camera_source::CameraSource;
pub use distorted_photo::DistortedPhoto;
pub use document_file::{FORMAT_VERSION, MAX_FILE_BYTES, SceneFile};
pub use edited_light::{EditedLight, OctreeChange};
pub use error::{FrameError, SceneError};
pub use estimate::{Estimate, EstimateOrigin};
pub use expected::ExpectedLight;
pub use frame::Frame;
pub use inferred_light::{CONTRASTS, InferredLight, LightEffect, LightMode, LightTuning, WARMTHS_EV};
pub use light_edits::{
    AddedLight, AnalyticLight, EmitterEdit, LightChange, LightColor, LightEdits, LightShape, MAX_KELVIN,
    MAX_LIGHT_EDITS, MAX_LIGHT_POSITION_M, MAX_LIGHT_RADIANCE, MAX_LIGHT_SCALE, MAX_LIGHT_SIZE_M, MAX_SUN_RADIUS_DEG,
    MIN_KELVIN, MIN_LIGHT_SIZE_M, MIN_SUN_RADIUS_DEG,
};
pub use lit_scene::LitScene;
pub use observed_photo::ObservedPhoto;
pub use overlap::{ExposureRatio, Overlap, overlap};
pub use panorama::{PanoramaContribution, PanoramaImage, PanoramaSource};
pub use placement::place_cube;
pub use plain_name::{is_invisible, plain_name};
pub use posed_frame::{OtherPhoto, PosedFrame};
pub use resample::{resized_photo, working_photo};
pub use room::{Completion, Room, RoomPlane, Side};
pub use scaling::{KnownLength, KnownLengthError, ROOM_SCALES};
pub use scene_objects::{
    MAX_FPS, MAX_FRAMES, MAX_OBJECT_FILES, MAX_OBJECT_LAYOUT, MAX_TIME_S, ObjectDisplay, SceneObjects,
};
pub use surfel::Surfel;
pub use undistortion::{Undistortion, UndistortionError};
