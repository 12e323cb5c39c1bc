//! Voxel cone tracing of a lighting octree: colour, expected distance and opacity, forward and exact backward (`docs/method.md` §3).
//!
//! Three things differ from the paper by measurement against rooms of known radiance (`tests/it/room.rs`, PSNR of sRGB-encoded
//! panoramas clipped to [0, 1], d = 7 / 8). The half-angle of a pixel's cone is half of its pitch, not the pitch: 30.5 / 32.2 dB
//! instead of 28.1 / 28.4 dB in an axis-aligned room. Reading opacity from the nearest node closes cracks between nodes: 27 to
//! 28 / 30 dB instead of 25 to 26 / 27 dB in rooms that are turned against the cube, for 0.4 dB in one that is not. And radiance
//! is blended between nodes: 1.5 / 1.8 dB on top.

mod gradient;
mod grid;
mod local_cone;
mod march;
mod packets;
mod reconstruction;
mod settings;
mod steps;
mod trace;
mod tracer;
mod viewers;

pub use gradient::{Gradients, SampleGradient};
pub use settings::{Cone, ConeSample, Rendering, SampleWeight, Sampling, Settings, SettingsError, StepRule};
pub use tracer::{ConeTracer, TracerError};
pub use viewers::Viewers;
