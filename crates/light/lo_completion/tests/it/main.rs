//! Rooms completed from photos and panoramas. A single binary, so that it is linked once.
#![allow(clippy::unwrap_used)]

mod panorama;
mod shell;
