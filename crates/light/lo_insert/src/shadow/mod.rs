//! Shadows of objects on real surfaces.

pub(crate) mod backdrop;
pub(crate) mod cap;
pub(crate) mod field;
pub(crate) mod ratio;
pub(crate) mod silhouette;
