//! The scene: a lighting octree together with the photo, depth and camera that object insertion needs, and its file.

mod frame;

use octree::LightOctree;

pub use frame::Frame;

/// Everything that `estimate` knows about a room; self-contained.
#[derive(Clone, Debug, PartialEq)]
pub struct Scene {
    /// Radiance of the whole room.
    pub light: LightOctree,
    /// The photo with its depth and camera.
    pub frame: Frame,
}
