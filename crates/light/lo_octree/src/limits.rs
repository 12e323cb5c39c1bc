//! Limits of octrees and their files.

/// Greatest full depth: 128³ nodes in the full level, 29 MB of structure.
pub const MAX_FULL_DEPTH: u32 = 7;

/// Opacity of leaves built from points, and greatest opacity of the levels above, so that extinctions stay finite.
pub const MAX_ALPHA: f32 = 1.0 - 1e-4;

/// Smallest edge of an octree's cube, metres.
pub const MIN_CUBE_EDGE_M: f32 = 1e-3;

/// Largest edge of an octree's cube and largest coordinate of its corner, metres.
pub const MAX_CUBE_EDGE_M: f32 = 1e6;

/// Largest radiance of a node: squares of it, edited by gains of lights, are finite in `f32`.
pub const MAX_RADIANCE: f32 = 1e14;

/// Version of the tensor layout that this crate writes and reads.
pub const FORMAT_VERSION: u32 = 1;
