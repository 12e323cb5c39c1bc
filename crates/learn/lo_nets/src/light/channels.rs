//! Channels of the light network's input and output, and the limit of radiance.

/// Number of input features of a node; see [`LightInput::features`](super::LightInput::features).
pub const NODE_FEATURES: usize = 15;

/// Columns of a node's input features.
pub(crate) mod columns {
    use std::ops::Range;

    /// Mean log(1 + radiance) of the node's points, or the single map's for carriers of `f_L`.
    pub const LOG_RADIANCE: Range<usize> = 0..3;
    /// Mean position of the points in the node, −1 to 1.
    pub const OFFSET: Range<usize> = 3..6;
    /// Centre of the node in the cube, −1 to 1.
    pub const CENTRE: Range<usize> = 6..9;
    /// Mean normal of the points, or a horizontal surface's for carriers of `f_L`.
    pub const NORMAL: Range<usize> = 9..12;
    /// Share of the points that are visible.
    pub const VISIBLE: usize = 12;
    /// Share of the points whose radiance is certain.
    pub const CERTAIN: usize = 13;
    /// Share of the points that carry `f_L`.
    pub const CARRIER: usize = 14;
}

/// Maximum radiance of the output: the largest finite half-precision number.
pub const MAX_RADIANCE: f32 = 65_504.0;

/// Outputs of the regression module for each node: radiance (3), correction of observed radiance (3), opacity, error,
/// and the single map's share of the initial radiance.
pub(crate) const RAW_CHANNELS: usize = 9;

/// Channels of [`NodeLight`](super::NodeLight).
pub(crate) const LIGHT_CHANNELS: usize = 5;

/// Channels of a lobe.
pub(crate) const LOBE_CHANNELS: usize = 3;
