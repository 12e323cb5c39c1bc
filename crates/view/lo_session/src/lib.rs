//! A session at a scene: objects and lights that somebody moves about, with undo, and the pictures of them. What `lightoctree view` shows, without HTTP.
//!
//! - [`OpenScene`]: a scene, made ready once.
//! - [`Session`]: what stands where, changed by [`Command`]s; a gesture is previewed, then kept or dropped; undo and redo without limit.
//! - [`Renderer`]: pictures in [`Step`]s, from a small draft while something moves to the picture that `lightoctree insert --quality high` writes. The
//!   library's events report and cancel.
//! - [`insert_command`] is that command line, [`outputs`] what is taken away, [`Probe`] the light at a place, [`overlay`] what is known of the room, [`Outside`] the
//!   room from wherever one likes.
//!
//! Everything that stands in a [`State`] can be said on the command line of `insert`, so that the two make the same picture by construction.

mod command;
mod command_line;
mod drag;
mod enlarged;
mod error;
mod keyframes;
mod light;
mod lit;
mod mesh;
mod object;
mod open;
pub mod outputs;
mod outside;
mod overlay;
mod probe;
mod renderer;
mod saved;
mod sequence;
mod session;
mod state;
mod view;
mod visible;

pub use command::Command;
pub use command_line::{insert_command, insert_words};
pub use enlarged::Part;
pub use error::SessionError;
pub use light::NewLight;
pub use lit::LitScenes;
pub use mesh::{Files, Mesh, ObjectMaterial};
pub use object::{Object, Place, Size};
pub use open::{OpenScene, RoomExtent};
pub use outside::{Outside, OutsideView};
pub use overlay::{Overlay, OverlayPicture, overlay};
pub use probe::{Probe, ProbePictures, probe_place};
pub use renderer::{MOVING_SIDES, RESTING_SIDE, Renderer, Step};
pub use sequence::Sequence;
pub use session::Session;
pub use state::State;
pub use view::{GuessedLightView, LightView, ObjectView, SessionView, TimelineView};
