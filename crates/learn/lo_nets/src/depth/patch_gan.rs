use burn::module::Module;
use burn::nn::conv::Conv2d;
use burn::tensor::{Device, Tensor, activation};

use crate::conv::conv2d;
use crate::depth::layers::conv;

/// Conditional PatchGAN discriminator (Isola et al. 2017): whether each patch of a panorama is real, given what the photo shows.
#[derive(Module, Debug)]
pub struct PatchGan {
    /// Half the resolution each.
    pub stages: Vec<Conv2d>,
    /// To one logit a patch.
    pub output: Conv2d,
}

impl PatchGan {
    /// A discriminator with weights drawn from `seed`.
    pub fn new(seed: u64, device: &Device) -> Self {
        let mut stream = lo_random::stream(seed, "discriminator", 0);
        let mut stage = |channels| conv(channels, 3, 2, true, &mut stream, device);
        let stages = vec![stage([7, 32]), stage([32, 64]), stage([64, 128])];
        Self { stages, output: conv([128, 1], 3, 1, true, &mut stream, device) }
    }

    /// `panorama[3, images, height, width]`: linear radiance; `condition[4, images, height, width]`: what the photo shows of it,
    /// linear radiance and 1 where it shows something. Gives logits `[1, images, height / 8, width / 8]`.
    pub fn forward(&self, panorama: Tensor<4>, condition: Tensor<4>) -> Tensor<4> {
        let shown = condition.clone().narrow(0, 0, 3).log1p();
        let mask = condition.narrow(0, 3, 1);
        let x = Tensor::cat(vec![panorama.log1p(), shown, mask], 0);
        let x = self.stages.iter().fold(x, |x, stage| activation::leaky_relu(conv2d(x, stage), 0.2));
        conv2d(x, &self.output)
    }

    /// What the discriminator minimises in its own step: cross-entropy on a true panorama and one that was made (whose maker
    /// gets no gradient).
    pub fn discriminator_loss(&self, real: Tensor<4>, made: Tensor<4>, condition: Tensor<4>) -> Tensor<1> {
        let real = activation::softplus(self.forward(real, condition.clone()).neg(), 1.0).mean();
        let made = activation::softplus(self.forward(made.detach(), condition), 1.0).mean();
        (real + made) * 0.5
    }

    /// What the maker of a panorama minimises: cross-entropy of its being taken for real.
    pub fn generator_loss(&self, made: Tensor<4>, condition: Tensor<4>) -> Tensor<1> {
        activation::softplus(self.forward(made, condition).neg(), 1.0).mean()
    }
}
