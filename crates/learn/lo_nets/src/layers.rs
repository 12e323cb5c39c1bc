//! Layers of the light network: each a handful of weights around an operation of [`crate::graph`].

use std::sync::Arc;

use burn::module::{Module, Param, ParamId};
use burn::tensor::{Device, Tensor, TensorData};
use lo_random::{RngExt, Stream};

use crate::graph::{
    Activation, GraphLevel, down_sample, graph_conv, linear, normalise, normalise_and_add, type_channels_of, up_sample,
};

/// Weights `[rows, columns]`, uniform in ±√(6 / (`fan_in` + `fan_out`)) (Glorot & Bengio 2010).
pub fn glorot(size: [usize; 2], fans: [usize; 2], stream: &mut Stream, device: &Device) -> Param<Tensor<2>> {
    let bound = (6.0 / (fans[0] + fans[1]) as f32).sqrt();
    drawn(size, stream, device, move |stream| stream.random_range(-bound..bound))
}

/// Weights that are drawn when they are first used: those that a file replaces are not.
pub(crate) fn drawn<const D: usize>(
    size: [usize; D],
    stream: &mut Stream,
    device: &Device,
    draw: impl Fn(&mut Stream) -> f32 + Send + Sync + 'static,
) -> Param<Tensor<D>> {
    // A stream of their own, so that they do not depend on what is used first.
    let seed = stream.random();
    let init = move |device: &Device, recording: bool| {
        let mut stream = lo_random::stream(seed, "weights", 0);
        let values = (0..size.iter().product()).map(|_| draw(&mut stream)).collect();
        Tensor::from_data(TensorData::new::<f32, _>(values, size), device).set_require_grad(recording)
    };
    Param::uninitialized(ParamId::new(), init, device.clone(), true, size.into())
}

/// [`graph_conv`] with its weights.
#[derive(Module, Debug)]
pub struct GraphConv {
    /// `[7 · (in + depths), out]`.
    pub weights: Param<Tensor<2>>,
}

impl GraphConv {
    /// For graphs whose nodes have `depths` different depths.
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

/// Normalisation by the statistics of the tree at hand, in training and in use.
///
/// With one scene a step, statistics that run over scenes are not those of any scene: a dual octree's features have means that
/// depend on how much of it is empty. So there are none, and a network computes in use what it computed in training. Where
/// every channel is its own group this is batch normalisation as it trains.
#[derive(Module, Debug)]
pub struct Norm {
    /// Scale and shift, `[2, channels]`.
    pub affine: Param<Tensor<2>>,
    groups: usize,
}

impl Norm {
    /// Groups of `channels_per_group` channels (or all, where there are fewer).
    pub fn new(channels: usize, channels_per_group: usize, device: &Device) -> Self {
        let values = (0..2 * channels).map(|i| if i < channels { 1.0 } else { 0.0 }).collect();
        let affine = Param::from_data(TensorData::new::<f32, _>(values, [2, channels]), device);
        Self { affine, groups: channels / channels_per_group.min(channels) }
    }

    /// `[nodes, channels] → [nodes, channels]`.
    pub fn forward(&self, x: Tensor<2>, activation: Activation) -> Tensor<2> {
        normalise(x, self.affine.val(), self.groups, activation)
    }

    /// The same with `skip` added before the activation.
    pub fn forward_and_add(&self, x: Tensor<2>, skip: Tensor<2>, activation: Activation) -> Tensor<2> {
        normalise_and_add(x, self.affine.val(), skip, self.groups, activation)
    }
}

/// Residual block (He et al. 2016): two graph convolutions.
#[derive(Module, Debug)]
pub struct ResBlock {
    /// First convolution, to the channels between.
    pub first: GraphConv,
    /// After the first convolution.
    pub first_norm: Norm,
    /// Second convolution, back to all channels.
    pub second: GraphConv,
    /// After the second convolution.
    pub second_norm: Norm,
}

impl ResBlock {
    /// `channels` in and out, `between` in the middle.
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

/// A linear map, where wanted with a shift.
#[derive(Module, Debug)]
pub struct Linear {
    /// `[in, out]`.
    pub weights: Param<Tensor<2>>,
    /// `[1, out]`.
    pub bias: Option<Param<Tensor<2>>>,
}

impl Linear {
    /// Without a shift.
    pub fn new(size: [usize; 2], stream: &mut Stream, device: &Device) -> Self {
        Self { weights: glorot(size, size, stream, device), bias: None }
    }

    /// With a shift that begins at 0.
    pub fn with_bias(size: [usize; 2], stream: &mut Stream, device: &Device) -> Self {
        let bias = Param::from_data(TensorData::new(vec![0.0f32; size[1]], [1, size[1]]), device);
        Self { bias: Some(bias), ..Self::new(size, stream, device) }
    }

    /// All weights 0: the output is `bias` until something is learned.
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

/// A linear map, normalised and activated: between stages of different width.
#[derive(Module, Debug)]
pub struct Projection {
    /// The map.
    pub linear: Linear,
    /// After it.
    pub norm: Norm,
}

impl Projection {
    /// `[nodes, in] → [nodes, out]`.
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
    /// To the coarser stage's channels.
    pub projection: Projection,
}

impl DownSample {
    /// From `inputs` to `outputs` channels.
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
    /// To the finer stage's channels.
    pub projection: Projection,
}

impl UpSample {
    /// From `inputs` to `outputs` channels.
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

/// Two fully connected layers for each node: the prediction and the regression module.
#[derive(Module, Debug)]
pub struct Head {
    /// Hidden layer.
    pub hidden: Projection,
    /// Output.
    pub output: Linear,
}

impl Head {
    /// Gives `bias` everywhere until something is learned.
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
