//! Photo lookup in rooms, also with edited lights. A single binary, so that it is linked once.
#![allow(clippy::unwrap_used, missing_docs)]

mod detail;
mod edited_lights;
mod room;
