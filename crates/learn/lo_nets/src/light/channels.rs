//! Channels of the light network's input and output, and the limit of radiance.

/// Number of input features of a node; see [`LightInput::features`](super::LightInput::features).
pub const NODE_FEATURES: usize = 15;

/// Maximum radiance of the output: the largest finite half-precision number.
pub const MAX_RADIANCE: f32 = 65_504.0;

/// Outputs of the regression module for each node: radiance (3), correction of observed radiance (3), opacity, error,
/// and
/// the single map's share of the initial radiance.
pub(crate) const RAW_CHANNELS: usize = 9;

/// Channels of [`NodeLight`](super::NodeLight).
pub(crate) const LIGHT_CHANNELS: usize = 5;

/// Channels of a lobe.
pub(crate) const LOBE_CHANNELS: usize = 3;
