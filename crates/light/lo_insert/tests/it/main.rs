//! Objects in photos. One binary, so that it is linked once.
#![allow(clippy::unwrap_used)]

mod box_room;
mod reference;

mod edited_lights;
mod insertion;
mod mirror;
mod several;
mod truth;
