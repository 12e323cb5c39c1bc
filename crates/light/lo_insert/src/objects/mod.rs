//! Objects: models at their places, what carries them, layouts and paths.

pub(crate) mod base;
pub(crate) mod carried;
pub(crate) mod ground;
pub(crate) mod instance;
pub(crate) mod layout;
pub(crate) mod object;
pub(crate) mod patches;
pub(crate) mod path;
pub(crate) mod placement;
pub(crate) mod tracing;
