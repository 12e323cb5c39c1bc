//! Footage: the images of a moving camera, the plates of a shot, in the room of a scene that was estimated from one of
//! them.
//!
//! A [`Shot`] has the pose of each plate's camera in the room. For each plate it makes an [`lo_insert::Plate`]:
//!
//! - *Scale* (`scale`): the length of the track's unit by which the scene's surfaces land where the plates show them.
//! - *Surfaces* (`surfaces`): depth from the camera, rendered from the surfaces that the scene's photo shows, else from
//!   the room's planes and the octree. The same surfaces serve all plates, so that mattes and shadows do not flicker.
//! - *Exposure*: by pixels that show one surface in the plate and in the scene's photo.
//!
//! People and things that move in front of an object hide it only in plates with measured depth.

mod error;
mod reference;
mod scale;
mod shot;
mod surfaces;
mod warning;

pub use error::ShotError;
pub use reference::likeness;
pub use scale::{ScaleFit, ScaleSource};
pub use shot::Shot;
pub use surfaces::SceneSurfaces;
pub use warning::ShotWarning;
