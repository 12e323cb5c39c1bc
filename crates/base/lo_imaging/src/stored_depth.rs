use crate::DepthMap;

/// Values of a depth map as stored in the file, before scaling to metres.
pub(crate) struct StoredDepth {
    pub values: DepthMap,
    /// Whether the file stores integers, which are millimetres by default.
    pub integers: bool,
}
