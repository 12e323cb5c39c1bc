//! Cones through octrees of rooms. A single binary, so that it is linked once.
#![allow(clippy::unwrap_used)]

mod common;

mod agreement;
mod room;
