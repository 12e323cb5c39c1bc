//! From a photo's features to one vector and to panoramas that hold for the whole photo.

use burn::module::Module;
use burn::tensor::{Device, Tensor};
use lo_nets::depth::{GlobalEncoder, PanoramaDecoder};
use lo_random::Stream;

use crate::features::{FeatureBatch, FeatureShape};

/// Length of the vector that the encoder adds to `f_L`.
const OWN: usize = 128;

/// Encoder from the last features to a global vector: `f_L` of the frozen network, and a trained one beside it.
#[derive(Module, Debug)]
pub struct GlobalPath {
    /// Trained encoder.
    pub encoder: GlobalEncoder,
}

impl GlobalPath {
    pub(crate) fn new(shape: FeatureShape, stream: &mut Stream, device: &Device) -> Self {
        Self { encoder: GlobalEncoder::new([shape.last, OWN], stream, device) }
    }

    /// Returns the length of the vector.
    pub(crate) fn length(shape: FeatureShape) -> usize {
        shape.global + OWN
    }

    /// Returns `[images, length]`, which ends with the photos' log mean colours.
    pub(crate) fn forward(&self, batch: &FeatureBatch) -> Tensor<2> {
        let own = self.encoder.forward(batch.last.clone(), batch.log_colour.clone());
        Tensor::cat(vec![batch.global.clone(), own], 1)
    }
}

/// Network from a photo's features to equirectangular images around the camera.
#[derive(Module, Debug)]
pub struct MapNet {
    /// Global vector.
    pub global: GlobalPath,
    /// Decoder of the vector.
    pub decoder: PanoramaDecoder,
}

impl MapNet {
    /// Creates a network with stages of these channels, from 4 × 8 pixels on, and `outputs` channels.
    pub(crate) fn new(
        shape: FeatureShape,
        channels: &[usize],
        outputs: usize,
        stream: &mut Stream,
        device: &Device,
    ) -> Self {
        Self {
            global: GlobalPath::new(shape, stream, device),
            decoder: PanoramaDecoder::with_shape(GlobalPath::length(shape), channels, outputs, stream, device),
        }
    }

    /// Returns linear radiance relative to the photo's mean colour, `[3, images, height, 2 · height]`.
    pub(crate) fn radiance(&self, batch: &FeatureBatch) -> Tensor<4> {
        self.decoder.forward(self.global.forward(batch))
    }

    /// Returns the decoder's outputs, `[outputs, images, height, 2 · height]`.
    pub(crate) fn outputs(&self, batch: &FeatureBatch) -> Tensor<4> {
        self.decoder.decode(self.global.forward(batch))
    }
}
