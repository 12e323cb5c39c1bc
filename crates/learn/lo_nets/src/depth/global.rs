use burn::module::Module;
use burn::nn::conv::Conv2d;
use burn::tensor::{Device, Tensor, activation, activation::relu, module::adaptive_avg_pool2d};
use lo_random::Stream;

use crate::conv::{conv2d, upsample_nearest};
use crate::depth::decoder::ConvStage;
use crate::depth::layers::conv;
use crate::layers::Linear;
use crate::light::MAX_RADIANCE;

/// Grid of cells that features are averaged over, so that `f_L` can encode where light comes from.
const CELLS: [usize; 2] = [4, 6];
const CELL_CHANNELS: usize = 64;
const HIDDEN: usize = 256;

/// Channels of the panorama decoder, from 4 × 8 to 64 × 128 pixels.
const PANORAMA_CHANNELS: [usize; 5] = [256, 128, 64, 32, 16];

/// Length of the photo's log mean linear colour at the end of `f_L`.
const COLOUR: usize = 3;

/// Encoder from image features and the photo's mean colour to the global lighting feature `f_L`.
///
/// Image features are nearly invariant to brightness and tint, which light is measured in. So `f_L` ends with the
/// logarithms of the photo's mean colour, and the panorama is predicted relative to it.
#[derive(Module, Debug)]
pub struct GlobalEncoder {
    /// 1 × 1 convolution.
    pub conv: Conv2d,
    /// Fully connected layer over all cells.
    pub hidden: Linear,
    /// Fully connected layer to `f_L` without the photo's colour.
    pub output: Linear,
}

/// Decoder from `f_L` to a small HDR panorama.
#[derive(Module, Debug)]
pub struct PanoramaDecoder {
    /// Fully connected layer to 4 × 8 pixels.
    pub input: Linear,
    /// Stages that each double the resolution.
    pub stages: Vec<ConvStage>,
    /// Convolution to log radiance relative to the photo's colour.
    pub output: Conv2d,
}

impl GlobalEncoder {
    /// Creates an encoder from `channels` channels to an `f_L` of `features` numbers, of which the last three are the
    /// photo's log mean colour.
    pub fn new([channels, features]: [usize; 2], stream: &mut Stream, device: &Device) -> Self {
        Self {
            conv: conv([channels, CELL_CHANNELS], 1, 1, true, stream, device),
            hidden: Linear::with_bias([CELLS[0] * CELLS[1] * CELL_CHANNELS, HIDDEN], stream, device),
            output: Linear::with_bias([HIDDEN, features - COLOUR], stream, device),
        }
    }

    /// Encodes `[channels, images, height, width]` and the photos' log mean colours `[images, 3]` to
    /// `f_L [images, features]`.
    pub fn forward(&self, x: Tensor<4>, log_colour: Tensor<2>) -> Tensor<2> {
        let cells = adaptive_avg_pool2d(relu(conv2d(x, &self.conv)), CELLS);
        let features = self.output.forward(relu(self.hidden.forward(cells.swap_dims(0, 1).flatten(1, 3))));
        Tensor::cat(vec![features, log_colour], 1)
    }
}

impl PanoramaDecoder {
    pub(super) fn new(features: usize, stream: &mut Stream, device: &Device) -> Self {
        Self::with_shape(features, &PANORAMA_CHANNELS, 3, stream, device)
    }

    /// Creates a decoder whose stages have these channels, from 4 × 8 pixels on, each with twice the resolution of the
    /// one before, to `outputs` channels.
    ///
    /// # Panics
    /// Without channels.
    pub fn with_shape(
        features: usize,
        channels: &[usize],
        outputs: usize,
        stream: &mut Stream,
        device: &Device,
    ) -> Self {
        let (first, last) = (channels[0], channels[channels.len() - 1]);
        let input = Linear::with_bias([features, first * 4 * 8], stream, device);
        let stages = channels.windows(2).map(|pair| ConvStage::new([pair[0], pair[1]], stream, device));
        let (stages, output) = (stages.collect(), conv([last, outputs], 3, 1, true, stream, device));
        Self { input, stages, output }
    }

    /// Decodes `f_L [images, features]` to linear radiance `[3, images, height, 2 · height]`: equirectangular panoramas
    /// at the cameras, of 64 × 128 pixels in the depth network. The decoder must have three outputs.
    pub fn forward(&self, features: Tensor<2>) -> Tensor<4> {
        let [images, length] = features.dims();
        let log_colour = features.clone().narrow(1, length - COLOUR, COLOUR);
        let log = self.decode(features) + log_colour.swap_dims(0, 1).reshape([COLOUR, images, 1, 1]);
        let log = activation::softplus(log, 1.0);
        log.clamp_max(f64::from(MAX_RADIANCE).ln_1p()).exp() - 1.0
    }

    /// Decodes `[images, features]` to the outputs of the last convolution, `[outputs, images, height, 2 · height]`:
    /// equirectangular images of any quantity.
    pub fn decode(&self, features: Tensor<2>) -> Tensor<4> {
        let images = features.dims()[0];
        let x = relu(self.input.forward(features));
        let first = x.dims()[1] / (4 * 8);
        let x = x.reshape([images, first, 4, 8]).swap_dims(0, 1);
        let x = self.stages.iter().fold(x, |x, stage| {
            let x = upsample_nearest(x, None);
            let width = x.dims()[3];
            stage.forward(wrapped(x)).narrow(3, 1, width)
        });
        let width = x.dims()[3];
        conv2d(wrapped(x), &self.output).narrow(3, 1, width)
    }
}

/// Pads by one wrapped column on either side, as panoramas are periodic.
fn wrapped(x: Tensor<4>) -> Tensor<4> {
    let width = x.dims()[3];
    Tensor::cat(vec![x.clone().narrow(3, width - 1, 1), x.clone(), x.narrow(3, 0, 1)], 3)
}
