//! Layers of the light network: weights for the operations of [`crate::graph`].

use std::sync::Arc;

use burn::module::{Module, Param, ParamId};
use burn::tensor::{Device, Tensor, TensorData};
use lo_random::{RngExt, Stream};

use crate::graph::{
    Activation, GraphLevel, down_sample, graph_conv, linear, normalise, normalise_and_add, type_channels_of, up_sample,
};

/// Draws weights `[rows, columns]`, uniform in ±√(6 / (`fan_in` + `fan_out`)) (Glorot & Bengio 2010).
pub fn glorot(size: [usize; 2], fans: [usize; 2], stream: &mut Stream, device: &Device) -> Param<Tensor<2>> {
    let bound = (6.0 / (fans[0] + fans[1]) as f32).sqrt();
    drawn(size, stream, device, move |stream| stream.random_range(-bound..bound))
}

/// Draws weights on first use, so that weights replaced from a file are never drawn.
pub(crate) fn drawn<const D: usize>(
    size: [usize; D],
    stream: &mut Stream,
    device: &Device,
    draw: impl Fn(&mut Stream) -> f32 + Send + Sync + 'static,
) -> Param<Tensor<D>> {
    // A separate stream makes the values independent of the order of first use.
    let seed = stream.random();
    let init = move |device: &Device, recording: bool| {
        let mut stream = lo_random::stream(seed, "weights", 0);
        let values = (0..size.iter().product()).map(|_| draw(&mut stream)).collect();
        Tensor::from_data(TensorData::new::<f32, _>(values, size), device).set_require_grad(recording)
    };
    Param::uninitialized(ParamId::new(), init, device.clone(), true, size.into())
}

/// [`graph_conv`] with weights.
#[derive(Module, Debug)]
pub struct GraphConv {
    /// `[7 · (in + depths), out]`.
    pub weights: Param<Tensor<2>>,
}

impl GraphConv {
    /// Creates the layer for graphs whose nodes have `depths` different depths.
    pub fn new([inputs, outputs]: [usize; 2], depths: usize, stream: &mut Stream, device: &Device) -> Self {
        let types = type_channels_of(depths);
        let weights = glorot([7 * (inputs + types), outputs], [7 * inputs, 7 * outputs], stream, device);
        Self { weights }
    }

    /// `[nodes, in] → [nodes, out]`.
    pub fn forward(&self, x: Tensor<2>, level: &Arc<GraphLevel>) -> Tensor<2> {
        graph_conv(x, self.weights.val(), level)
    }
}

/// Normalisation by the statistics of the current graph, in training and in inference.
///
/// There are no running statistics: features of a dual octree have means that depend on how much of it is empty, so
/// averages over scenes fit no scene. Inference thus computes exactly what training did. With one channel a group, this
/// is batch normalisation in training mode.
#[derive(Module, Debug)]
pub struct Norm {
    /// Scale and shift, `[2, channels]`.
    pub affine: Param<Tensor<2>>,
    groups: usize,
}

impl Norm {
    /// Creates groups of `channels_per_group` channels, or a single group where there are fewer channels.
    pub fn new(channels: usize, channels_per_group: usize, device: &Device) -> Self {
        let values = (0..2 * channels).map(|i| if i < channels { 1.0 } else { 0.0 }).collect();
        let affine = Param::from_data(TensorData::new::<f32, _>(values, [2, channels]), device);
        Self { affine, groups: channels / channels_per_group.min(channels) }
    }

    /// `[nodes, channels] → [nodes, channels]`.
    pub fn forward(&self, x: Tensor<2>, activation: Activation) -> Tensor<2> {
        normalise(x, self.affine.val(), self.groups, activation)
    }

    /// Adds `skip` between normalisation and activation. `[nodes, channels] → [nodes, channels]`.
    pub fn forward_and_add(&self, x: Tensor<2>, skip: Tensor<2>, activation: Activation) -> Tensor<2> {
        normalise_and_add(x, self.affine.val(), skip, self.groups, activation)
    }
}

/// Residual block of two graph convolutions (He et al. 2016).
#[derive(Module, Debug)]
pub struct ResBlock {
    /// First convolution, to the bottleneck's channels.
    pub first: GraphConv,
    /// After the first convolution.
    pub first_norm: Norm,
    /// Second convolution, back to all channels.
    pub second: GraphConv,
    /// After the second convolution.
    pub second_norm: Norm,
}

impl ResBlock {
    /// Creates a block with `channels` in and out, and `between` in its bottleneck.
    pub fn new(
        [channels, between]: [usize; 2],
        depths: usize,
        channels_per_group: usize,
        stream: &mut Stream,
        device: &Device,
    ) -> Self {
        Self {
            first: GraphConv::new([channels, between], depths, stream, device),
            first_norm: Norm::new(between, channels_per_group, device),
            second: GraphConv::new([between, channels], depths, stream, device),
            second_norm: Norm::new(channels, channels_per_group, device),
        }
    }

    /// `[nodes, channels] → [nodes, channels]`.
    pub fn forward(&self, x: Tensor<2>, level: &Arc<GraphLevel>) -> Tensor<2> {
        let y = self.first_norm.forward(self.first.forward(x.clone(), level), Activation::Relu);
        self.second_norm.forward_and_add(self.second.forward(y, level), x, Activation::Relu)
    }
}

/// Linear map with an optional bias.
#[derive(Module, Debug)]
pub struct Linear {
    /// `[in, out]`.
    pub weights: Param<Tensor<2>>,
    /// `[1, out]`.
    pub bias: Option<Param<Tensor<2>>>,
}

impl Linear {
    /// Creates a map without bias.
    pub fn new(size: [usize; 2], stream: &mut Stream, device: &Device) -> Self {
        Self { weights: glorot(size, size, stream, device), bias: None }
    }

    /// Creates a map whose bias starts at 0.
    pub fn with_bias(size: [usize; 2], stream: &mut Stream, device: &Device) -> Self {
        let bias = Param::from_data(TensorData::new(vec![0.0f32; size[1]], [1, size[1]]), device);
        Self { bias: Some(bias), ..Self::new(size, stream, device) }
    }

    /// Creates a map with weights of 0, whose initial output is `bias`.
    pub fn constant(inputs: usize, bias: &[f32], device: &Device) -> Self {
        let outputs = bias.len();
        let weights = Param::from_data(TensorData::new(vec![0.0f32; inputs * outputs], [inputs, outputs]), device);
        Self { weights, bias: Some(Param::from_data(TensorData::new(bias.to_vec(), [1, outputs]), device)) }
    }

    /// `[nodes, in] → [nodes, out]`.
    pub fn forward(&self, x: Tensor<2>) -> Tensor<2> {
        linear(x, self.weights.val(), self.bias.as_ref().map(Param::val))
    }
}

/// Linear map, normalised and activated, between stages of different width.
#[derive(Module, Debug)]
pub struct Projection {
    /// Linear map without bias.
    pub linear: Linear,
    /// Normalisation of its output.
    pub norm: Norm,
}

impl Projection {
    /// Creates a projection of `size` `[in, out]`.
    pub fn new(size: [usize; 2], channels_per_group: usize, stream: &mut Stream, device: &Device) -> Self {
        Self { linear: Linear::new(size, stream, device), norm: Norm::new(size[1], channels_per_group, device) }
    }

    /// `[nodes, in] → [nodes, out]`.
    pub fn forward(&self, x: Tensor<2>) -> Tensor<2> {
        self.norm.forward(self.linear.forward(x), Activation::Relu)
    }
}

/// [`down_sample`], then a projection to the width of the coarser stage.
#[derive(Module, Debug)]
pub struct DownSample {
    /// `[8 · in, in]`.
    pub weights: Param<Tensor<2>>,
    /// Projection to the coarser stage's channels.
    pub projection: Projection,
}

impl DownSample {
    /// Creates the layer for `size` `[in, out]` channels.
    pub fn new(size: [usize; 2], channels_per_group: usize, stream: &mut Stream, device: &Device) -> Self {
        let [inputs, _] = size;
        let weights = glorot([8 * inputs, inputs], [8 * inputs; 2], stream, device);
        Self { weights, projection: Projection::new(size, channels_per_group, stream, device) }
    }

    /// `[nodes of finer, in] → [nodes of the coarser level, out]`.
    pub fn forward(&self, x: Tensor<2>, finer: &Arc<GraphLevel>) -> Tensor<2> {
        self.projection.forward(down_sample(x, self.weights.val(), finer))
    }
}

/// [`up_sample`], then a projection to the width of the finer stage.
#[derive(Module, Debug)]
pub struct UpSample {
    /// `[in, 8 · in]`.
    pub weights: Param<Tensor<2>>,
    /// Projection to the finer stage's channels.
    pub projection: Projection,
}

impl UpSample {
    /// Creates the layer for `size` `[in, out]` channels.
    pub fn new(size: [usize; 2], channels_per_group: usize, stream: &mut Stream, device: &Device) -> Self {
        let [inputs, _] = size;
        let weights = glorot([inputs, 8 * inputs], [8 * inputs; 2], stream, device);
        Self { weights, projection: Projection::new(size, channels_per_group, stream, device) }
    }

    /// `[nodes of the coarser level, in] → [nodes of finer, out]`.
    pub fn forward(&self, x: Tensor<2>, finer: &Arc<GraphLevel>) -> Tensor<2> {
        self.projection.forward(up_sample(x, self.weights.val(), finer))
    }
}

/// Two fully connected layers applied to each node: the prediction or the regression module.
#[derive(Module, Debug)]
pub struct Head {
    /// Hidden layer.
    pub hidden: Projection,
    /// Output layer.
    pub output: Linear,
}

impl Head {
    /// Creates a head whose initial output is `bias` for every node.
    pub fn new(
        [inputs, hidden]: [usize; 2],
        bias: &[f32],
        channels_per_group: usize,
        stream: &mut Stream,
        device: &Device,
    ) -> Self {
        Self {
            hidden: Projection::new([inputs, hidden], channels_per_group, stream, device),
            output: Linear::constant(hidden, bias, device),
        }
    }

    /// `[nodes, in] → [nodes, out]`.
    pub fn forward(&self, x: Tensor<2>) -> Tensor<2> {
        self.output.forward(self.hidden.forward(x))
    }
}
