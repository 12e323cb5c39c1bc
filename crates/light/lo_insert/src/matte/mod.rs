//! Mattes where real surfaces hide an object.

pub(crate) mod alpha;
pub(crate) mod colour_sides;
pub(crate) mod nearest;
pub(crate) mod walk;
