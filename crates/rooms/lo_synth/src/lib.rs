//! Procedural indoor scenes generated from a seed: rooms, furniture, lamps and the outdoors behind the windows.
//!
//! [`Interior::generate`] returns a room as a [`lo_transport::World`]. [`Interior::camera_poses`] and
//! [`Interior::probe_positions`] return viewpoints inside it. Radiance is absolute: one unit is [`UNIT_CD_M2`].

mod camera;
mod chance;
mod close_up;
mod config;
mod description;
mod doors;
mod error;
mod folder;
mod furniture;
mod glb;
mod interior;
mod lighting;
mod object;
mod occupancy;
mod outdoors;
mod palette;
mod photometry;
mod pictures;
mod plan;
mod room_builder;
mod shell;
mod solids;
mod texture;
mod windows;

pub use camera::CameraPose;
pub use config::{SynthConfig, Tilt};
pub use description::{Description, LightingMode, Outline, RoomKind, Weather};
pub use error::SynthError;
pub use interior::Interior;
pub use object::Object;
pub use photometry::UNIT_CD_M2;
pub use room_builder::Support;
