//! Objects: placed models, their carriers, layouts and paths.

pub(crate) mod base;
pub(crate) mod below;
pub(crate) mod carrier;
pub(crate) mod glass;
pub(crate) mod ground;
pub(crate) mod instance;
pub(crate) mod layout;
pub(crate) mod object;
pub(crate) mod patches;
pub(crate) mod path;
pub(crate) mod placement;
pub(crate) mod ranges;
pub(crate) mod size;
pub(crate) mod tracing;
pub(crate) mod unit;
