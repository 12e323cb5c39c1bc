/// Why an octree cannot be built or read.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum OctreeError {
    /// The depth is outside of what keys and indices can hold.
    #[error("the octree's depth must lie between 1 and {max}, got {depth}", max = crate::MAX_DEPTH)]
    Depth {
        /// Depth as given.
        depth: u32,
    },
    /// The full depth is greater than the depth, or than what a full level may take.
    #[error(
        "the full depth must lie between 0 and the smaller of the depth ({depth}) and {max}, got {full_depth}",
        max = crate::MAX_FULL_DEPTH
    )]
    FullDepth {
        /// Full depth as given.
        full_depth: u32,
        /// Depth of the octree.
        depth: u32,
    },
    /// The cube has no volume, or is not finite.
    #[error("the cube must have a finite corner and a positive edge, got corner {origin_m:?} m and edge {edge_m} m")]
    Cube {
        /// Lowest corner as given, in metres.
        origin_m: [f32; 3],
        /// Edge as given, in metres.
        edge_m: f32,
    },
    /// A leaf's opacity is not a number in (0, 1].
    #[error("the opacity of occupied leaves must lie in (0, 1], got {0}")]
    Alpha(f32),
    /// Two lists that belong together differ in length.
    #[error("{what}: expected {expected} entries, got {got}")]
    Length {
        /// Which list.
        what: &'static str,
        /// Length that the others have.
        expected: usize,
        /// Length that it has.
        got: usize,
    },
    /// A leaf's key is not greater than the one before it, or too large for the depth.
    #[error("leaf {index} has key {key}, which is out of order or too large for depth {depth}")]
    LeafKey {
        /// Position of the leaf in the list.
        index: usize,
        /// Its shuffled key.
        key: u32,
        /// Depth of the leaves.
        depth: u32,
    },
    /// A leaf's feature is not a radiance or an opacity.
    #[error("leaf {index} holds {rgba:?}; radiance must be finite and not negative, opacity in [0, 1]")]
    LeafFeature {
        /// Position of the leaf in the list.
        index: usize,
        /// Its feature.
        rgba: [f32; 4],
    },
    /// The octree has the greatest depth already.
    #[error("an octree of depth {depth} cannot grow further")]
    Grow {
        /// Depth of the octree.
        depth: u32,
    },
    /// A node was labelled non-empty or split although its parent, or it, is empty.
    #[error("node {node} of level {depth} {what}")]
    Label {
        /// Level of the node.
        depth: u32,
        /// Index of the node in its level.
        node: usize,
        /// What is wrong with it.
        what: &'static str,
    },
    /// The file was written in a layout that this version does not know.
    #[error("the octree's format version is {got}; this program reads version {known}", known = crate::FORMAT_VERSION)]
    Version {
        /// Version in the file.
        got: u32,
    },
    /// A tensor is not in the file.
    #[error("tensor {tensor} is missing")]
    MissingTensor {
        /// Its name.
        tensor: String,
    },
    /// A tensor has another type or shape than the tensors before it say.
    #[error("tensor {tensor}: expected {expected}, got {got}")]
    Layout {
        /// Its name.
        tensor: String,
        /// Type and shape that it should have.
        expected: String,
        /// Type and shape that it has.
        got: String,
    },
    /// A value in a tensor is impossible.
    #[error("tensor {tensor}, entry {index} {what}")]
    Value {
        /// Name of the tensor.
        tensor: String,
        /// Index along the tensor's first axis.
        index: usize,
        /// What is wrong with it.
        what: &'static str,
    },
}
