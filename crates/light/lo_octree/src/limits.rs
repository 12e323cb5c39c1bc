//! Limits of octrees and their files.

/// Greatest full depth: 128³ nodes in the full level, 29 MB of structure.
pub const MAX_FULL_DEPTH: u32 = 7;

/// Opacity of leaves built from points, and greatest opacity of the levels above, so that extinctions stay finite.
pub const MAX_ALPHA: f32 = 1.0 - 1e-4;

/// Version of the tensor layout that this crate writes and reads.
pub const FORMAT_VERSION: u32 = 1;
