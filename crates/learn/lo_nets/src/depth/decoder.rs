use burn::module::Module;
use burn::nn::conv::Conv2d;
use burn::nn::{GroupNorm, GroupNormConfig};
use burn::tensor::{Device, Tensor};
use lo_random::Stream;

use crate::conv::{ChannelMoments, Rectifier, activate, conv2d, group_norm, upsample_nearest};
use crate::depth::layers::conv;

/// Channels of the decoder's stages at 1/16, 1/8, 1/4 and 1/2.
const CHANNELS: [usize; 4] = [256, 128, 64, 32];
/// Index of the stage at 1/8, and its channels.
const EIGHTH: usize = 1;
pub(super) const EIGHTH_CHANNELS: usize = CHANNELS[EIGHTH];

/// Decoder from the encoder's features to one channel at full resolution, with skip connections at 1/16, 1/8, 1/4 and
/// 1/2.
#[derive(Module, Debug)]
pub struct DepthDecoder {
    /// Stages from 1/16 to 1/2.
    pub stages: Vec<ConvStage>,
    /// Stage at full resolution.
    pub last: ConvStage,
    /// Convolution to one channel.
    pub output: Conv2d,
}

/// 3 × 3 convolution, group normalisation by each image's own statistics, ReLU.
#[derive(Module, Debug)]
pub struct ConvStage {
    /// 3 × 3 convolution.
    pub conv: Conv2d,
    /// Group normalisation of its output.
    pub norm: GroupNorm,
}

impl ConvStage {
    /// Creates the stage for `channels` `[in, out]`, in groups of eight.
    pub fn new(channels: [usize; 2], stream: &mut Stream, device: &Device) -> Self {
        let norm = GroupNormConfig::new((channels[1] / 8).max(1), channels[1]).init(device);
        Self { conv: conv(channels, 3, 1, false, stream, device), norm }
    }

    /// `[in, images, height, width] → [out, images, height, width]`.
    pub fn forward(&self, x: Tensor<4>) -> Tensor<4> {
        let x = conv2d(x, &self.conv);
        let affine = group_norm(&self.norm, &ChannelMoments::per_image(x.clone()));
        activate(x, affine, Rectifier::Relu)
    }
}

impl DepthDecoder {
    /// Creates a decoder for features of these channels, from 1/2 to 1/32.
    pub(super) fn new(features: [usize; 5], stream: &mut Stream, device: &Device) -> Self {
        let mut inputs = features[4];
        let skips = features[..4].iter().rev();
        let stages = skips.zip(CHANNELS).map(|(skip, outputs)| {
            let stage = ConvStage::new([inputs + skip, outputs], stream, device);
            inputs = outputs;
            stage
        });
        Self {
            stages: stages.collect(),
            last: ConvStage::new([CHANNELS[3], 16], stream, device),
            output: conv([16, 1], 3, 1, true, stream, device),
        }
    }

    /// Decodes the encoder's features to the decoder's features at 1/8.
    pub fn to_eighth(&self, features: [Tensor<4>; 5]) -> Tensor<4> {
        let [_, _, eighth, sixteenth, x] = features;
        self.stages(x, 0, [sixteenth, eighth])
    }

    /// Decodes from 1/8 to `[1, images, height, width]`. `skips` are the encoder's features at 1/4 and 1/2.
    pub fn from_eighth(&self, eighth: Tensor<4>, skips: [Tensor<4>; 2]) -> Tensor<4> {
        let x = self.stages(eighth, EIGHTH + 1, skips);
        conv2d(self.last.forward(upsample_nearest(x, None)), &self.output)
    }

    fn stages<const N: usize>(&self, x: Tensor<4>, first: usize, skips: [Tensor<4>; N]) -> Tensor<4> {
        let stages = self.stages[first..].iter().zip(skips);
        stages.fold(x, |x, (stage, skip)| stage.forward(upsample_nearest(x, Some(skip))))
    }
}
