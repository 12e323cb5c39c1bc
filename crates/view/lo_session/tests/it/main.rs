//! Integration tests of sessions, the choice of light, and the view from outside. One binary, to link only once.
#![allow(clippy::unwrap_used, missing_docs)]

mod inferred;
mod lights;
mod outside;
mod placing;
mod scale;
mod session;
