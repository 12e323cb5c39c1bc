//! Depth network (`docs/method.md` §4): depth, global lighting feature, single map, perspective field, and
//! discriminator.

mod decoder;
mod densenet;
mod efficientnet;
mod encoder;
mod global;
mod layers;
mod losses;
mod network;
mod patch_gan;
mod perspective;

pub use decoder::{ConvStage, DepthDecoder};
pub use densenet::{DENSENET_CHANNELS, DenseBlock, DenseLayer, DenseNet, Transition};
pub use efficientnet::{EfficientNetLite, EfficientNetScale, InvertedResidual, NormedConv, Separable};
pub use encoder::{Encoder, EncoderKind};
pub use global::{GlobalEncoder, PanoramaDecoder};
pub use layers::conv;
pub use losses::{DepthLossConfig, depth_losses, panorama_loss};
pub use network::{DepthNet, DepthNetConfig, DepthOutput, LONGER_SIDE, panorama_image, photo_within, size_within};
pub use patch_gan::PatchGan;
pub use perspective::{LensHead, PerspectiveHead, PerspectiveOutput, perspective_loss};
