use burn::module::Module;
use burn::nn::conv::Conv2d;
use burn::tensor::{Device, Tensor, activation};

use crate::conv::conv2d;
use crate::depth::layers::conv;

/// Conditional PatchGAN discriminator (Isola et al. 2017): judges whether each patch of a panorama is real, given the
/// photo.
#[derive(Module, Debug)]
pub struct PatchGan {
    /// Convolutions that each halve the resolution.
    pub stages: Vec<Conv2d>,
    /// Convolution to one logit per patch.
    pub output: Conv2d,
}

impl PatchGan {
    /// Creates a discriminator with weights drawn from `seed`.
    pub fn new(seed: u64, device: &Device) -> Self {
        let mut stream = lo_random::stream(seed, "discriminator", 0);
        let mut stage = |channels| conv(channels, 3, 2, true, &mut stream, device);
        let stages = vec![stage([7, 32]), stage([32, 64]), stage([64, 128])];
        Self { stages, output: conv([128, 1], 3, 1, true, &mut stream, device) }
    }

    /// Returns logits `[1, images, height / 8, width / 8]`.
    ///
    /// `panorama[3, images, height, width]` is linear radiance. `condition[4, images, height, width]` is the observed
    /// part: linear radiance, and a mask that is 1 where observed.
    pub fn forward(&self, panorama: Tensor<4>, condition: Tensor<4>) -> Tensor<4> {
        let shown = condition.clone().narrow(0, 0, 3).log1p();
        let mask = condition.narrow(0, 3, 1);
        let x = Tensor::cat(vec![panorama.log1p(), shown, mask], 0);
        let x = self.stages.iter().fold(x, |x, stage| activation::leaky_relu(conv2d(x, stage), 0.2));
        conv2d(x, &self.output)
    }

    /// Returns the discriminator's loss: cross-entropy on a true and a generated panorama. The generator gets no
    /// gradient.
    pub fn discriminator_loss(&self, real: Tensor<4>, generated: Tensor<4>, condition: Tensor<4>) -> Tensor<1> {
        let real = activation::softplus(self.forward(real, condition.clone()).neg(), 1.0).mean();
        let generated = activation::softplus(self.forward(generated.detach(), condition), 1.0).mean();
        (real + generated) * 0.5
    }

    /// Returns the generator's loss: cross-entropy of the generated panorama being classified as real.
    pub fn generator_loss(&self, generated: Tensor<4>, condition: Tensor<4>) -> Tensor<1> {
        activation::softplus(self.forward(generated, condition).neg(), 1.0).mean()
    }
}
