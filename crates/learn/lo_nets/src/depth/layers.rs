//! Convolutions and norms with their initial weights.

use burn::module::Param;
use burn::nn::conv::{Conv2d, Conv2dConfig};
use burn::nn::{BatchNorm, BatchNormConfig, PaddingConfig2d};
use burn::tensor::{Device, TensorData};
use lo_random::{RngExt, Stream};

use crate::layers::drawn;

/// Shape of a convolution.
#[derive(Clone, Copy, Debug)]
pub(super) struct ConvShape {
    /// Input and output channels.
    pub channels: [usize; 2],
    /// Side of the square kernel.
    pub kernel: usize,
    /// Input pixels between neighbouring output pixels.
    pub stride: usize,
    /// Zeros before and after the image, on both axes.
    pub padding: [usize; 2],
    /// Whether the convolution is depthwise.
    pub depthwise: bool,
    /// Whether it has a bias.
    pub bias: bool,
}

impl ConvShape {
    /// Draws weights from a normal distribution of variance 2 / fan-in (He et al. 2015), as torchvision does.
    pub fn init(self, stream: &mut Stream, device: &Device) -> Conv2d {
        let Self { channels: [inputs, outputs], kernel, stride, padding: [before, after], depthwise, bias } = self;
        let mut conv = Conv2dConfig::new([inputs, outputs], [kernel, kernel])
            .with_stride([stride, stride])
            .with_padding(PaddingConfig2d::Explicit(before, before, after, after))
            .with_groups(if depthwise { inputs } else { 1 })
            .with_bias(bias)
            .init(device);
        let inputs = if depthwise { 1 } else { inputs };
        let deviation = (2.0 / (inputs * kernel * kernel) as f32).sqrt();
        let size = [outputs, inputs, kernel, kernel];
        conv.weight = drawn(size, stream, device, move |stream| deviation * normal(stream));
        conv.bias = bias.then(|| Param::from_data(TensorData::new(vec![0.0f32; outputs], [outputs]), device));
        conv
    }
}

/// Creates a convolution of a square kernel with symmetric padding, with weights as torchvision draws them.
pub fn conv(
    channels: [usize; 2],
    kernel: usize,
    stride: usize,
    bias: bool,
    stream: &mut Stream,
    device: &Device,
) -> Conv2d {
    let padding = [(kernel - 1) / 2; 2];
    ConvShape { channels, kernel, stride, padding, depthwise: false, bias }.init(stream, device)
}

/// Draws from the standard normal distribution (Box & Muller 1958).
fn normal(stream: &mut Stream) -> f32 {
    let radius = (-2.0 * (1.0 - stream.random::<f32>()).ln()).sqrt();
    radius * (std::f32::consts::TAU * stream.random::<f32>()).cos()
}

pub(super) fn norm(channels: usize, device: &Device) -> BatchNorm {
    BatchNormConfig::new(channels).init(device)
}
