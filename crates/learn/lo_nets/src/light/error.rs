use lo_cone::TracerError;
use lo_geometry::Cube;
use lo_octree::OctreeError;

use crate::light::VisiblePoint;

/// Error of the light network.
#[derive(Debug, thiserror::Error)]
pub enum LightError {
    /// A point is not finite, or its radiance is negative.
    #[error(
        "visible point {index} is invalid: position, normal and radiance must be finite, and radiance not negative; it is {point:?}"
    )]
    Point {
        /// Index of the point.
        index: usize,
        /// The invalid point.
        point: VisiblePoint,
    },
    /// The octree's shape is not supported.
    #[error(transparent)]
    Octree(#[from] OctreeError),
    /// The input, or the octree to grow along, does not have the network's depths.
    #[error("{what} has depths {got_full} to {got}, but the network has depths {full} to {depth}")]
    Depths {
        /// Name of the octree.
        what: &'static str,
        /// Full depth of the octree.
        got_full: u32,
        /// Depth of the octree.
        got: u32,
        /// Full depth of the network.
        full: u32,
        /// Depth of the network.
        depth: u32,
    },
    /// The true octree covers another cube than the output.
    #[error("the true octree covers {truth:?}, but the predicted octree covers {output:?}")]
    Cubes {
        /// Cube of the true octree.
        truth: Cube,
        /// Cube of the output.
        output: Cube,
    },
    /// Tracing settings out of range.
    #[error(transparent)]
    Settings(#[from] TracerError),
    /// The network's output is NaN or infinite.
    #[error("the network's {what} at depth {depth} are NaN or infinite; check the weights and the input")]
    NotFinite {
        /// Name of the output.
        what: &'static str,
        /// Depth of the nodes.
        depth: u32,
    },
}

/// Error of a light network's configuration.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum LightConfigError {
    /// A field is out of range.
    #[error("{field} is {value}; it must be between {min} and {max}")]
    OutOfRange {
        /// Name of the field of [`LightNetConfig`](crate::light::LightNetConfig).
        field: &'static str,
        /// Value of the field.
        value: usize,
        /// Minimum, given the other fields.
        min: usize,
        /// Maximum, given the other fields.
        max: usize,
    },
    /// `map_share` is out of range.
    #[error("map_share is {0}; it must be between 0 and 1")]
    MapShare(f32),
    /// A layer's channels cannot be divided into groups of this size.
    #[error("{channels} channels cannot be divided into groups of {group}; change channels_per_group")]
    Groups {
        /// Channels of a layer.
        channels: usize,
        /// Channels per group.
        group: usize,
    },
}
