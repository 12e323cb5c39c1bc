//! How many numbers the light network takes in and gives out for a node, and their bound.

/// Features of a node of the input: see [`LightInput::features`](super::LightInput::features).
pub const NODE_FEATURES: usize = 15;

/// Greatest radiance that comes out: what a half-precision file can hold.
pub const MAX_RADIANCE: f32 = 65_504.0;

/// Outputs of the regression module for each node: radiance (3), correction of known radiance (3), opacity, error, and the single map's share of the
/// first guess.
pub(crate) const RAW_CHANNELS: usize = 9;

/// Channels of [`NodeLight`](super::NodeLight).
pub(crate) const LIGHT_CHANNELS: usize = 5;

/// Numbers of a lobe.
pub(crate) const LOBE_CHANNELS: usize = 3;
