//! Rooms with what the photo knows, and with edited lights. One binary, so that it is linked once.
#![allow(clippy::unwrap_used, missing_docs)]

mod detail;
mod edited_lights;
mod room;
