//! Tests of object insertion, in one binary to link once.
#![allow(clippy::unwrap_used)]

mod box_room;
mod reference;

mod edited_lights;
mod glass;
mod insertion;
mod look;
mod mirror;
mod passes;
mod placing;
mod plates;
mod several;
mod truth;
