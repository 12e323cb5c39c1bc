//! An interactive editing session of one scene: objects, lights, undo, and progressive rendering. `lightoctree view`
//! without HTTP.
//!
//! - [`OpenScene`]: a scene prepared for editing.
//! - [`Session`]: the edited [`State`], changed by [`Command`]s. A gesture is previewed, then committed or cancelled.
//!   Undo and redo are unlimited.
//! - [`Renderer`]: renders in [`RenderStep`]s, from a small draft during a movement to the image that
//!   `lightoctree insert --quality high` writes. The library's events report progress and cancel.
//! - [`insert_command`]: that command line. [`outputs`]: downloadable files. [`Probe`]: the light at a point.
//! - [`overlay`]: depth, normals, levels and provenance over the photo. [`OutsideRenderer`]: the room from any
//!   viewpoint.
//!
//! The command line of `insert` can express every [`State`], so both render the same image by construction.

mod command;
mod command_line;
mod draft_patch;
mod drag;
mod error;
mod first_size;
mod free_place;
mod history;
mod key_times;
mod keyframes;
mod light;
mod light_commands;
mod lit;
mod mesh;
mod new_object;
mod object;
mod object_position;
mod open;
pub mod outputs;
mod outside;
mod outside_rays;
mod overlay;
mod probe;
mod renderer;
mod saved;
mod scaled_scenes;
mod sequence;
mod session;
mod snap;
mod state;
mod sun_shadow;
mod view;
mod visibility;

pub use command::Command;
pub use command_line::{insert_argv, insert_command};
pub use draft_patch::ImagePatch;
pub use error::SessionError;
pub use light::NewLight;
pub use lit::LitSceneCache;
pub use lo_scene::plain_name;
pub use mesh::{Files, Mesh, ObjectMaterial};
pub use object::{Object, ObjectSize};
pub use object_position::ObjectPosition;
pub use open::{OpenScene, RoomExtent};
pub use outside::{OutsideRenderer, OutsideView};
pub use overlay::{Overlay, OverlayImage, overlay};
pub use probe::{Probe, ProbeImages, probe_position};
pub use renderer::{MOVING_SIDES, RESTING_SIDE, RenderStep, Renderer};
pub use sequence::Sequence;
pub use session::Session;
pub use state::State;
pub use view::{InferredLightView, LightView, ObjectView, SessionView, ShadowView, TimelineView};
