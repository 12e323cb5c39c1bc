use crate::DepthMap;

/// Samples of a depth map as stored, and whether they were integers.
pub(crate) struct Samples {
    pub values: DepthMap,
    pub integers: bool,
}
