//! The scene: a lighting octree together with the photo, depth and camera that object insertion needs, and its file.

mod error;
mod frame;
mod resample;
mod room;
mod surfel;

use octree::LightOctree;

pub use error::FrameError;
pub use frame::Frame;
pub use room::{Completion, Room, RoomPlane, Side};
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
    /// Gravity and the closing planes, where they are known.
    pub room: Option<Room>,
    /// Names of the files that the scene was made from, without folders.
    pub sources: Vec<String>,
}
