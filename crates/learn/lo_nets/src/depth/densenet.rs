use burn::module::Module;
use burn::nn::BatchNorm;
use burn::nn::conv::Conv2d;
use burn::tensor::{Device, Tensor};
use lo_random::Stream;

use crate::checkpoint::{Checkpoint, CheckpointError};
use crate::conv::{
    ChannelMoments, Rectifier, activate, activated_conv2d, activated_mean, batch_norm, conv2d, max_pool, scaled,
};
use crate::depth::layers::{conv, norm};

/// Channels that a dense layer adds, and channels of its bottleneck.
const GROWTH: usize = 32;
const BOTTLENECK: usize = 4 * GROWTH;

/// Number of layers in the four dense blocks.
const LAYERS: [usize; 4] = [6, 12, 24, 16];

/// Channels of the five outputs of [`DenseNet::forward`].
pub const DENSENET_CHANNELS: [usize; 5] = [64, 256, 512, 1024, 1024];

/// Feature extractor of DenseNet-121 (Huang et al. 2017) in torchvision's layout, whose weights load by name.
#[derive(Module, Debug)]
pub struct DenseNet {
    /// 7 × 7 convolution with stride 2.
    pub conv0: Conv2d,
    /// Normalisation of its output.
    pub norm0: BatchNorm,
    /// Dense blocks.
    pub blocks: Vec<DenseBlock>,
    /// Transitions between the blocks.
    pub transitions: Vec<Transition>,
    /// Normalisation of the last block's output.
    pub norm5: BatchNorm,
}

/// Dense block: each layer receives the outputs of all previous ones.
#[derive(Module, Debug)]
pub struct DenseBlock {
    /// Layers in order.
    pub layers: Vec<DenseLayer>,
}

/// Bottleneck layer of a dense block.
#[derive(Module, Debug)]
pub struct DenseLayer {
    /// Normalisation before `conv1`.
    pub norm1: BatchNorm,
    /// 1 × 1 convolution.
    pub conv1: Conv2d,
    /// Normalisation before `conv2`.
    pub norm2: BatchNorm,
    /// 3 × 3 convolution.
    pub conv2: Conv2d,
}

/// Transition that halves channels and resolution.
#[derive(Module, Debug)]
pub struct Transition {
    /// Normalisation before the convolution.
    pub norm: BatchNorm,
    /// 1 × 1 convolution.
    pub conv: Conv2d,
}

impl DenseNet {
    /// Creates a network with random weights.
    pub fn new(stream: &mut Stream, device: &Device) -> Self {
        let mut channels = DENSENET_CHANNELS[0];
        let (mut blocks, mut transitions) = (Vec::new(), Vec::new());
        let conv0 = conv([3, channels], 7, 2, false, stream, device);
        for (i, layers) in LAYERS.into_iter().enumerate() {
            let layer = |i| DenseLayer::new(channels + i * GROWTH, stream, device);
            blocks.push(DenseBlock { layers: (0..layers).map(layer).collect() });
            channels += layers * GROWTH;
            if i + 1 < LAYERS.len() {
                let half = conv([channels, channels / 2], 1, 1, false, stream, device);
                transitions.push(Transition { norm: norm(channels, device), conv: half });
                channels /= 2;
            }
        }
        Self { conv0, norm0: norm(DENSENET_CHANNELS[0], device), blocks, transitions, norm5: norm(channels, device) }
    }

    /// Loads the weights of torchvision's `densenet121`. Its classifier is not used.
    ///
    /// # Errors
    /// Names the weights that are missing or of another shape.
    pub fn load_torchvision(self, weights: &Checkpoint) -> Result<Self, CheckpointError> {
        weights.load_renamed("DenseNet-121", self, |name| {
            let name = torchvision_name(name);
            // torchvision's download still uses the names of its first release.
            let old = ["norm1", "norm2", "conv1", "conv2"].into_iter().fold(name.clone(), |name, part| {
                let (kind, number) = part.split_at(4);
                name.replace(&format!(".{part}."), &format!(".{kind}.{number}."))
            });
            if !weights.has(&name) && weights.has(&old) { old } else { name }
        })
    }

    pub(super) fn norms_mut(&mut self) -> Vec<&mut BatchNorm> {
        let layers = self.blocks.iter_mut().flat_map(|block| &mut block.layers);
        let norms = layers.flat_map(|layer| [&mut layer.norm1, &mut layer.norm2]);
        let norms = norms.chain(self.transitions.iter_mut().map(|transition| &mut transition.norm));
        norms.chain([&mut self.norm0, &mut self.norm5]).collect()
    }

    /// Returns features at 1/2, 1/4, 1/8, 1/16 and 1/32 of `[3, images, height, width]`, whose sides are multiples of
    /// 32. Their channels are [`DENSENET_CHANNELS`].
    pub fn forward(&self, x: Tensor<4>) -> [Tensor<4>; 5] {
        let x = conv2d(x, &self.conv0);
        let affine = batch_norm(&self.norm0, ChannelMoments::in_training(&x).as_ref());
        let half = activate(x, affine, Rectifier::Relu);
        let mut x = max_pool(half.clone());
        let mut outputs = Vec::new();
        for (i, block) in self.blocks.iter().enumerate() {
            let (features, moments) = block.forward(x);
            x = match self.transitions.get(i) {
                Some(transition) => {
                    outputs.push(features.clone());
                    transition.forward(features, moments.as_ref())
                }
                None => scaled(features, batch_norm(&self.norm5, moments.as_ref())),
            };
        }
        let [quarter, eighth, sixteenth] = outputs.try_into().expect("three transitions");
        [half, quarter, eighth, sixteenth, x]
    }
}

impl DenseBlock {
    /// Returns the output and, in training, the moments of its channels.
    fn forward(&self, x: Tensor<4>) -> (Tensor<4>, Option<ChannelMoments>) {
        let Some(moments) = ChannelMoments::in_training(&x) else { return (self.forward_in_place(x), None) };
        self.layers.iter().fold((x, Some(moments)), |(x, moments), layer| {
            let new = layer.forward(x.clone(), moments.as_ref());
            let moments = moments.map(|moments| moments.joined(ChannelMoments::new(new.clone())));
            (Tensor::cat(vec![x, new], 0), moments)
        })
    }

    /// Without gradients, all layers write into one tensor, which avoids copying the previous outputs for each layer.
    fn forward_in_place(&self, x: Tensor<4>) -> Tensor<4> {
        let [inputs, images, height, width] = x.dims();
        let channels = inputs + self.layers.len() * GROWTH;
        let features = Tensor::zeros([channels, images, height, width], (&x.device(), x.dtype()));
        let mut features = features.slice_assign([0..inputs, 0..images, 0..height, 0..width], x);
        for (i, layer) in self.layers.iter().enumerate() {
            let seen = inputs + i * GROWTH;
            let new = layer.forward(features.clone().narrow(0, 0, seen), None);
            features = features.slice_assign([seen..seen + GROWTH, 0..images, 0..height, 0..width], new);
        }
        features
    }
}

impl DenseLayer {
    fn new(inputs: usize, stream: &mut Stream, device: &Device) -> Self {
        Self {
            norm1: norm(inputs, device),
            conv1: conv([inputs, BOTTLENECK], 1, 1, false, stream, device),
            norm2: norm(BOTTLENECK, device),
            conv2: conv([BOTTLENECK, GROWTH], 3, 1, false, stream, device),
        }
    }

    fn forward(&self, x: Tensor<4>, moments: Option<&ChannelMoments>) -> Tensor<4> {
        let x = activated_conv2d(x, batch_norm(&self.norm1, moments), Rectifier::Relu, &self.conv1);
        let affine = batch_norm(&self.norm2, ChannelMoments::in_training(&x).as_ref());
        activated_conv2d(x, affine, Rectifier::Relu, &self.conv2)
    }
}

impl Transition {
    fn forward(&self, x: Tensor<4>, moments: Option<&ChannelMoments>) -> Tensor<4> {
        // torchvision pools after the convolution. Both operations commute, and in this order there are a quarter of
        // the products.
        conv2d(activated_mean(x, batch_norm(&self.norm, moments)), &self.conv)
    }
}

/// Returns torchvision's name of a parameter. torchvision counts blocks and layers from 1.
fn torchvision_name(name: &str) -> String {
    let mut parts = name.split('.');
    let mut out = "features".to_owned();
    let mut counted = |kind: &str, parts: &mut std::str::Split<char>| {
        let number: usize = parts.next().and_then(|n| n.parse().ok()).expect("a list's fields are numbered");
        out.push_str(&format!(".{kind}{}", number + 1));
    };
    let mut rest = Vec::new();
    while let Some(part) = parts.next() {
        match part {
            "blocks" => counted("denseblock", &mut parts),
            "layers" => counted("denselayer", &mut parts),
            "transitions" => counted("transition", &mut parts),
            "gamma" => rest.push("weight"),
            "beta" => rest.push("bias"),
            other => rest.push(other),
        }
    }
    rest.iter().for_each(|part| out.push_str(&format!(".{part}")));
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_those_of_torchvision() {
        for (ours, theirs) in [
            ("conv0.weight", "features.conv0.weight"),
            ("norm0.running_mean", "features.norm0.running_mean"),
            ("blocks.2.layers.11.norm2.gamma", "features.denseblock3.denselayer12.norm2.weight"),
            ("transitions.0.conv.weight", "features.transition1.conv.weight"),
            ("norm5.beta", "features.norm5.bias"),
        ] {
            assert_eq!(torchvision_name(ours), theirs);
        }
    }
}
