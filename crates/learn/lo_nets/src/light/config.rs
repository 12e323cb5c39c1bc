use lo_geometry::Vec3;
use lo_imaging::RadianceImage;
use serde::{Deserialize, Serialize};

use crate::graph::type_channels_of;
use crate::light::channels::{LOBE_CHANNELS, NODE_FEATURES, RAW_CHANNELS};
use crate::light::error::LightConfigError;
use crate::light::LightInput;

/// Shape of the light network. Every field has a default, so that a file need name only what differs.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct LightNetConfig {
    /// Depth of the octree, `full_depth` to 8.
    pub depth: u32,
    /// Depth from which on the octree is sparse; the coarsest stage.
    pub full_depth: u32,
    /// Channels at the finest stage.
    pub channels: usize,
    /// Greatest number of channels; they double from stage to stage until then.
    pub max_channels: usize,
    /// Residual blocks of each stage.
    pub blocks: usize,
    /// Channels of a residual block ÷ channels between its two convolutions.
    pub bottleneck: usize,
    /// Hidden channels of the two heads of each stage.
    pub head_channels: usize,
    /// Channels whose mean and variance are taken together; 1 is batch normalisation on the tree at hand.
    pub channels_per_group: usize,
    /// Length of the global lighting feature `f_L`, whose last three numbers are the photo's colour.
    pub global_features: usize,
    /// Channels that `f_L` is projected to before it joins the other features of a node.
    pub global_channels: usize,
    /// Share of the single map in the first guess of what is not seen, beside the ambient light's, 0 to 1. By default the network gives a share for each node;
    /// networks trained before that have a fixed one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub map_share: Option<f32>,
    /// Whether each node has a spherical Gaussian lobe beside its radiance (variant "SG" of the paper).
    pub lobes: bool,
    /// Greatest number of nodes of a graph that the network may grow to by its own predictions (and a family of eight for each depth beyond). Growth along a
    /// truth knows no budget. `None`: [`LightNetConfig::node_budget`] follows the depth.
    pub max_nodes: Option<usize>,
}

impl Default for LightNetConfig {
    fn default() -> Self {
        Self {
            depth: 7,
            full_depth: 4,
            channels: 32,
            max_channels: 256,
            blocks: 2,
            bottleneck: 4,
            head_channels: 32,
            channels_per_group: 4,
            global_features: 64,
            global_channels: 8,
            map_share: None,
            lobes: false,
            max_nodes: None,
        }
    }
}

impl LightNetConfig {
    /// Checks what types cannot say.
    ///
    /// # Errors
    /// See [`LightConfigError`].
    pub fn validate(&self) -> Result<(), LightConfigError> {
        let ranges = [
            ("full_depth", self.full_depth as usize, 1, 6),
            ("depth", self.depth as usize, self.full_depth as usize, 8),
            ("channels", self.channels, 1, 1024),
            ("max_channels", self.max_channels, self.channels, 4096),
            ("blocks", self.blocks, 1, 16),
            ("bottleneck", self.bottleneck, 1, self.channels),
            ("head_channels", self.head_channels, 1, 1024),
            ("channels_per_group", self.channels_per_group, 1, 4096),
            ("global_features", self.global_features, 4, 1024),
            ("global_channels", self.global_channels, 1, 1024),
            ("max_nodes", self.node_budget(), 1 << (3 * self.full_depth.min(6)), 1 << 24),
        ];
        if let Some((field, value, min, max)) =
            ranges.into_iter().find(|(_, value, min, max)| !(min..=max).contains(&value))
        {
            return Err(LightConfigError::OutOfRange { field, value, min, max });
        }
        if let Some(share) = self.map_share.filter(|share| !(0.0..=1.0).contains(share)) {
            return Err(LightConfigError::MapShare(share));
        }
        let widths = self.stages().map(|depth| self.stage_channels(depth)).chain([self.head_channels]);
        for width in widths.flat_map(|width| [width, width / self.bottleneck]) {
            if !width.is_multiple_of(self.channels_per_group.min(width)) {
                return Err(LightConfigError::Groups { channels: width, group: self.channels_per_group });
            }
        }
        Ok(())
    }

    /// An input with what the network is told beside points: the unit vector against gravity, and the single map.
    pub fn told(&self, input: LightInput, up: Vec3, single_map: RadianceImage) -> LightInput {
        input.with_up(up).with_map(single_map)
    }

    /// Number of weights of the network.
    pub fn weights(&self) -> u64 {
        let projection = |inputs: usize, outputs: usize| (inputs + 2) * outputs;
        let stage = |depth: u32| {
            let (channels, types) = (self.stage_channels(depth), type_channels_of(self.depths(depth)));
            let between = channels / self.bottleneck;
            let convolutions = 7 * (channels + types) * between + 7 * (between + types) * channels;
            self.blocks * (convolutions + 2 * (between + channels))
        };
        let heads = |depth: u32| {
            let hidden = self.head_channels;
            2 * projection(self.stage_channels(depth), hidden) + (hidden + 1) * (1 + self.raw_channels())
        };
        // From this stage to the one above it and back.
        let between = |depth: u32| {
            let (fine, coarse) = (self.stage_channels(depth), self.stage_channels(depth - 1));
            8 * (fine * fine + coarse * coarse) + projection(fine, coarse) + projection(coarse, fine)
        };
        let inputs = NODE_FEATURES + self.global_channels + type_channels_of(self.depths(self.depth));
        let start = self.global_features * self.global_channels + (7 * inputs + 2) * self.stage_channels(self.depth);
        let all = self.stages().map(|depth| stage(depth) + heads(depth)).sum::<usize>();
        let finer = (self.full_depth + 1..=self.depth).map(|depth| stage(depth) + between(depth)).sum::<usize>();
        (start + all + finer) as u64
    }

    /// Greatest number of nodes of a graph: `max_nodes`, or else about three and a half times what a generated room has at this depth, 1,600,000 at
    /// d = 8 and a quarter of that for each depth less (rooms of seed 7: 29,000 nodes at d = 6, 117,000 at 7, 488,000 at 8).
    pub fn node_budget(&self) -> usize {
        let full = 1usize << (3 * self.full_depth.min(6));
        self.max_nodes.unwrap_or_else(|| (1_600_000 >> (2 * 8u32.saturating_sub(self.depth))).max(2 * full))
    }

    /// Outputs of the regression module.
    pub(crate) fn raw_channels(&self) -> usize {
        let share = usize::from(self.map_share.is_none());
        RAW_CHANNELS - 1 + share + if self.lobes { LOBE_CHANNELS } else { 0 }
    }

    /// Depths of the stages, the coarsest first.
    pub fn stages(&self) -> impl DoubleEndedIterator<Item = u32> + use<> {
        self.full_depth..=self.depth
    }

    /// Channels of the stage of this depth.
    pub fn stage_channels(&self, depth: u32) -> usize {
        (self.channels << (self.depth - depth)).min(self.max_channels)
    }

    /// Number of different depths of the nodes of a stage's graph.
    pub(crate) fn depths(&self, depth: u32) -> usize {
        (depth - self.full_depth + 1) as usize
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shares_are_checked() {
        let refusal = |map_share| {
            let config = LightNetConfig { map_share: Some(map_share), ..LightNetConfig::default() };
            config.validate().map_err(|error| error.to_string())
        };
        assert_eq!((refusal(0.0), refusal(1.0)), (Ok(()), Ok(())));
        assert_eq!(refusal(1.5), Err("map_share is 1.5; it goes from 0 to 1".into()));
        assert_eq!(refusal(f32::NAN), Err("map_share is NaN; it goes from 0 to 1".into()));
    }

    #[test]
    fn the_budget_follows_the_depth_and_holds_a_room() {
        let budget = |depth| LightNetConfig { depth, ..LightNetConfig::default() }.node_budget();
        assert_eq!([6, 7, 8].map(budget), [100_000, 400_000, 1_600_000]);
        // docs/method.md §5.9: nodes of the graph of a generated room.
        for (depth, room) in [(6, 28_771), (7, 117_475), (8, 488_146)] {
            assert!(budget(depth) > 3 * room, "{depth}");
        }
        let all = LightNetConfig { depth: 4, ..LightNetConfig::default() };
        assert!(all.node_budget() >= 4096 && all.validate().is_ok());
        assert_eq!(LightNetConfig { max_nodes: Some(5000), ..all.clone() }.node_budget(), 5000);
        assert_eq!(
            LightNetConfig { max_nodes: Some(4095), ..all }.validate().map_err(|error| error.to_string()),
            Err("max_nodes is 4095; it must lie in 4096 to 16777216".into())
        );
    }
}
