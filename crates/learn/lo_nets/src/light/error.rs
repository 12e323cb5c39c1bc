use lo_cone::TracerError;
use lo_geometry::Cube;
use lo_octree::OctreeError;

use crate::light::VisiblePoint;

/// Why the light network cannot work on its input.
#[derive(Debug, thiserror::Error)]
pub enum LightError {
    /// A point is not finite, or its radiance is negative.
    #[error("visible point {index} is {point:?}; position, normal and radiance must be finite, radiance not negative")]
    Point {
        /// Its place in the list.
        index: usize,
        /// It.
        point: VisiblePoint,
    },
    /// No octree of this shape.
    #[error(transparent)]
    Octree(#[from] OctreeError),
    /// The input, or the tree to grow along, has other depths than the network.
    #[error("{what} reaches from depth {got_full} to {got}, but the network from {full} to {depth}")]
    Depths {
        /// Which octree.
        what: &'static str,
        /// Its full depth.
        got_full: u32,
        /// Its depth.
        got: u32,
        /// The network's full depth.
        full: u32,
        /// The network's depth.
        depth: u32,
    },
    /// The truth is of another part of the world.
    #[error("the true octree covers {truth:?}, but the network's {output:?}")]
    Cubes {
        /// The truth's.
        truth: Cube,
        /// The network's.
        output: Cube,
    },
    /// Tracing settings out of range.
    #[error(transparent)]
    Settings(#[from] TracerError),
    /// A network's output that is no number: its weights or its input are not.
    #[error("the network's {what} at depth {depth} are not finite")]
    NotFinite {
        /// Which output.
        what: &'static str,
        /// Where.
        depth: u32,
    },
}

/// Why there is no light network of a shape.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum LightConfigError {
    /// A field out of its range.
    #[error("{field} is {value}; it must lie in {min} to {max}")]
    OutOfRange {
        /// The field of [`LightNetConfig`](crate::light::LightNetConfig).
        field: &'static str,
        /// Its value.
        value: usize,
        /// The least one that is possible beside the other fields.
        min: usize,
        /// The greatest one.
        max: usize,
    },
    /// No share.
    #[error("map_share is {0}; it goes from 0 to 1")]
    MapShare(f32),
    /// Channels cannot be normalised in groups of this size.
    #[error("{channels} channels do not divide into groups of {group}")]
    Groups {
        /// Channels of a layer.
        channels: usize,
        /// Channels per group.
        group: usize,
    },
}
