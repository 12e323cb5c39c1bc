//! What is inferred of a room ([`Estimate`]), the same in the light that renders it ([`LitScene`]), and the scene file.
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
mod derived;
mod document_file;
mod edited_light;
mod error;
mod estimate;
mod expected;
mod frame;
mod guessed_light;
mod light_edits;
mod lit_scene;
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

pub use camera_source::CameraSource;
pub use document_file::{FORMAT_VERSION, SceneFile};
pub use edited_light::{EditedLight, OctreeChange};
pub use error::{FrameError, SceneError};
pub use estimate::{Estimate, EstimateOrigin};
pub use expected::ExpectedLight;
pub use frame::Frame;
pub use guessed_light::{CONTRASTS, GuessedLight, LightEffect, LightMode, LightTuning, WARMTHS_EV};
pub use light_edits::{
    AddedLight, AnalyticLight, EmitterEdit, LightChange, LightColor, LightEdits, LightShape, MAX_KELVIN,
    MAX_LIGHT_EDITS, MAX_LIGHT_PLACE_M, MAX_LIGHT_RADIANCE, MAX_LIGHT_SCALE, MAX_LIGHT_SIZE_M, MAX_SUN_RADIUS_DEG,
    MIN_KELVIN, MIN_LIGHT_SIZE_M, MIN_SUN_RADIUS_DEG,
};
pub use lit_scene::LitScene;
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
