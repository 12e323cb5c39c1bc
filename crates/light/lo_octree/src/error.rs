/// Reasons why an octree cannot be built or read.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum OctreeError {
    /// The depth exceeds the range of keys and indices.
    #[error("the octree's depth must lie between 1 and {max}, got {depth}", max = crate::MAX_DEPTH)]
    Depth {
        /// Requested depth.
        depth: u32,
    },
    /// The full depth exceeds the depth or the limit of a full level.
    #[error(
        "the full depth must lie between 0 and the smaller of the depth ({depth}) and {max}, got {full_depth}",
        max = crate::MAX_FULL_DEPTH
    )]
    FullDepth {
        /// Requested full depth.
        full_depth: u32,
        /// Depth of the octree.
        depth: u32,
    },
    /// The cube's corner or edge is out of range.
    #[error(
        "the cube's edge must be from {min} to {max} m and its corner within ± {max} m, got corner {origin_m:?} m and edge {edge_m} m",
        min = crate::MIN_CUBE_EDGE_M, max = crate::MAX_CUBE_EDGE_M
    )]
    Cube {
        /// Lowest corner in metres.
        origin_m: [f32; 3],
        /// Edge in metres.
        edge_m: f32,
    },
    /// A leaf's opacity is not a number in (0, 1].
    #[error("the opacity of occupied leaves must lie in (0, 1], got {0}")]
    Alpha(f32),
    /// Two lists that belong together differ in length.
    #[error("{what}: expected {expected} entries, got {got}")]
    Length {
        /// Name of the list.
        what: &'static str,
        /// Length of the other lists.
        expected: usize,
        /// Length of this list.
        got: usize,
    },
    /// A leaf's key is not greater than the one before it, or too large for the depth.
    #[error("leaf {index} has key {key}, which is out of order or too large for depth {depth}")]
    LeafKey {
        /// Position of the leaf in the list.
        index: usize,
        /// Shuffled key.
        key: u32,
        /// Depth of the leaves.
        depth: u32,
    },
    /// A leaf's feature is not a radiance or an opacity.
    #[error("leaf {index} holds {rgba:?}; radiance must be from 0 to {max:e}, opacity in [0, 1]", max = crate::MAX_RADIANCE)]
    LeafFeature {
        /// Position of the leaf in the list.
        index: usize,
        /// The feature.
        rgba: [f32; 4],
    },
    /// The octree already has the greatest depth.
    #[error("an octree of depth {depth} cannot grow further")]
    Grow {
        /// Depth of the octree.
        depth: u32,
    },
    /// A node was labelled non-empty or split although it or its parent is empty.
    #[error("node {node} of level {depth} {what}")]
    Label {
        /// Level of the node.
        depth: u32,
        /// Index of the node in its level.
        node: usize,
        /// The problem, as the end of a sentence.
        what: &'static str,
    },
    /// The file uses a format version that this program does not support.
    #[error("the octree's format version is {got}; this program reads version {known}", known = crate::FORMAT_VERSION)]
    Version {
        /// Version in the file.
        got: u32,
    },
    /// A tensor is not in the file.
    #[error("tensor {tensor} is missing")]
    MissingTensor {
        /// Name of the tensor.
        tensor: String,
    },
    /// A tensor has an unexpected type or shape.
    #[error("tensor {tensor}: expected {expected}, got {got}")]
    Layout {
        /// Name of the tensor.
        tensor: String,
        /// Expected type and shape.
        expected: String,
        /// Actual type and shape.
        got: String,
    },
    /// A value in a tensor is invalid.
    #[error("tensor {tensor}, entry {index} {what}")]
    Value {
        /// Name of the tensor.
        tensor: String,
        /// Index along the tensor's first axis.
        index: usize,
        /// The problem, as the end of a sentence.
        what: &'static str,
    },
}
