use std::any::TypeId;

use rayon::prelude::*;

use crate::conv::activation::{Affine, Rectifier, activation_backward, total};
use crate::conv::bands::{MIN_TASKS, by_bands};
use crate::conv::bf16;
use crate::conv::window::Window;
use crate::cpu_ops::{Kernel, Number};
use crate::gemm::GROUP;

/// Maximum number of input channels whose weight gradients are computed together.
const CHANNELS: usize = 32;

/// Convolves `x[channels, images · height · width]` with `weights[outputs, channels · kernel²]` and an optional third
/// input. Returns `[outputs, images · height · width]` of the output.
#[derive(Clone, Copy, Debug)]
pub struct ConvKernel {
    /// Geometry of the convolution.
    pub window: Window,
    /// Meaning of the third input.
    pub third_input: ThirdInput,
    /// Multiplies `f32` numbers in bf16.
    pub use_bf16: bool,
}

/// Third input of a [`ConvKernel`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ThirdInput {
    /// No third input.
    None,
    /// `[1, outputs]`: added to the output.
    Bias,
    /// `[3, channels]`: scale, centre and shift. The convolved values are scale · (x − centre) + shift, rectified; they
    /// are never stored.
    Activation(Rectifier),
}

impl ConvKernel {
    fn bias<'a, T>(&self, inputs: &[&'a [T]]) -> Option<&'a [T]> {
        (self.third_input == ThirdInput::Bias).then(|| inputs[2])
    }

    /// Returns the inputs as f32 where products are to be bf16.
    fn f32_inputs<'a, T: Number>(&self, inputs: &[&'a [T]]) -> Option<Vec<&'a [f32]>> {
        if self.use_bf16 { inputs.iter().map(|input| f32s(input)).collect() } else { None }
    }

    fn activation<'a, T: Number>(&self, inputs: &[&'a [T]]) -> Option<Affine<'a, T>> {
        let ThirdInput::Activation(rectifier) = self.third_input else { return None };
        Some(Affine::new(inputs[2], rectifier))
    }
}

impl Kernel for ConvKernel {
    fn output_size(&self, sizes: &[[usize; 2]]) -> [usize; 2] {
        let ([channels, area], [outputs, windows]) = (sizes[0], sizes[1]);
        assert_eq!(area, self.window.input_area(), "the images have the window's size");
        assert_eq!(windows, channels * self.window.kernel.pow(2), "weights for each channel");
        match self.third_input {
            ThirdInput::None => assert_eq!(sizes.len(), 2, "no third input"),
            ThirdInput::Bias => assert_eq!(sizes[2], [1, outputs], "one bias for each output"),
            ThirdInput::Activation(_) => {
                assert_eq!(sizes[2], [3, channels], "a scale, a centre and a shift for each channel")
            }
        }
        [outputs, self.window.images * self.window.area()]
    }

    fn forward<T: Number>(&self, inputs: &[&[T]], sizes: &[[usize; 2]]) -> Vec<T> {
        let ([outputs, _], [_, windows]) = (self.output_size(sizes), sizes[1]);
        if let Some(inputs_f32) = self.f32_inputs(inputs) {
            let taps = self.window.kernel.pow(2);
            let weight = |output, channel, tap| inputs_f32[1][output * windows + channel * taps + tap];
            let (activation, bias) = (self.activation(&inputs_f32), self.bias(&inputs_f32));
            return of_f32s(bf16::convolve(&self.window, inputs_f32[0], activation, &weight, outputs, bias));
        }
        let weights = grouped(outputs, [1, windows], |output, _| &inputs[1][output * windows..][..windows]);
        convolve(&self.window, inputs[0], self.activation(inputs), &weights, outputs, self.bias(inputs))
    }

    fn backward<T: Number>(
        &self,
        inputs: &[&[T]],
        sizes: &[[usize; 2]],
        gradient: &[T],
        wanted: &[bool],
    ) -> Vec<Vec<T>> {
        let ([outputs, area], [channels, _]) = (self.output_size(sizes), sizes[0]);
        let activation = self.activation(inputs);
        let f32s_and_gradient = self.f32_inputs(inputs).zip(f32s(gradient));
        let mut derivatives = vec![Vec::new(); inputs.len()];
        if wanted[0] || (activation.is_some() && wanted[2]) {
            // The gradient of the convolved values is a convolution with the flipped weights.
            let (taps, window) = (self.window.kernel.pow(2), self.window.transposed());
            derivatives[0] = if let Some((inputs_f32, gradient)) = &f32s_and_gradient {
                let weight =
                    |channel, output, tap| inputs_f32[1][(output * channels + channel) * taps + taps - 1 - tap];
                of_f32s(bf16::convolve(&window, gradient, None, &weight, channels, None))
            } else {
                let turned: Vec<T> = inputs[1].par_iter().rev().copied().collect();
                let weights = grouped(channels, [outputs, taps], |channel, output| {
                    &turned[((outputs - 1 - output) * channels + channels - 1 - channel) * taps..][..taps]
                });
                convolve(&window, gradient, None, &weights, channels, None)
            };
            if let Some(activation) = activation {
                derivatives[2] = activation_backward(&mut derivatives[0], inputs[0], activation, true);
            }
        }
        if wanted[1] {
            derivatives[1] = if let Some((inputs_f32, gradient)) = &f32s_and_gradient {
                of_f32s(bf16::weight_gradient(
                    &self.window,
                    inputs_f32[0],
                    self.activation(inputs_f32),
                    gradient,
                    outputs,
                ))
            } else {
                weight_gradient(&self.window, inputs[0], activation, gradient, outputs)
            };
        }
        if self.third_input == ThirdInput::Bias && wanted[2] {
            derivatives[2] = gradient.par_chunks(area.max(1)).map(|row| T::from_f64(total(row))).collect();
        }
        derivatives
    }
}

/// Reinterprets numbers that are `f32`.
fn f32s<T: Number>(numbers: &[T]) -> Option<&[f32]> {
    (TypeId::of::<T>() == TypeId::of::<f32>()).then(|| bytemuck::cast_slice(numbers))
}

/// Reinterprets `f32` numbers as `T`, which must be `f32`.
fn of_f32s<T: Number>(numbers: Vec<f32>) -> Vec<T> {
    bytemuck::cast_vec(numbers)
}

/// Arranges `runs` of `length` weights for each row, from `weights(row, run)`, as
/// `[rows / GROUP, runs, length, GROUP]`.
fn grouped<'a, T: Number>(
    rows: usize,
    [runs, length]: [usize; 2],
    weights: impl Fn(usize, usize) -> &'a [T] + Sync,
) -> Vec<T> {
    let mut out = vec![T::default(); rows.div_ceil(GROUP) * runs * length * GROUP];
    out.par_chunks_mut(runs * length * GROUP).enumerate().for_each(|(group, out)| {
        for (run, out) in out.chunks_exact_mut(length * GROUP).enumerate() {
            // Past the last row, it is repeated and its result dropped.
            let rows: [&[T]; GROUP] =
                std::array::from_fn(|i| &weights((group * GROUP + i).min(rows - 1), run)[..length]);
            for (k, out) in out.as_chunks_mut::<GROUP>().0.iter_mut().enumerate() {
                *out = rows.map(|row| row[k]);
            }
        }
    });
    out
}

fn convolve<T: Number>(
    window: &Window,
    x: &[T],
    activation: Option<Affine<T>>,
    weights: &[T],
    outputs: usize,
    bias: Option<&[T]>,
) -> Vec<T> {
    let channels = x.len() / window.input_area();
    let rows = window.band_rows(channels);
    let offsets = window.offsets(channels, rows);
    let read = |band: &mut Vec<T>, first| window.read(band, [first, rows], x, activation);
    let sums = |band: &Vec<T>, group: usize, out: &mut [&mut [T]]| {
        T::outer(&weights[group * offsets.len() * GROUP..][..offsets.len() * GROUP], band, &offsets, out);
    };
    by_bands(window, rows, [outputs, GROUP], bias, read, sums)
}

/// Returns the gradient of the weights, `[outputs, channels · kernel²]`.
fn weight_gradient<T: Number>(
    window: &Window,
    x: &[T],
    activation: Option<Affine<T>>,
    gradient: &[T],
    outputs: usize,
) -> Vec<T> {
    let taps = window.kernel.pow(2);
    let (height, width, pitch) = (window.rows(), window.output[1], window.pitch());
    let area = window.input_area();
    let all = x.len() / area;
    let some = all.div_ceil(MIN_TASKS).min(CHANNELS);
    let rows = window.band_rows(some);
    // The gradient as one tall image with rows as wide as the bands', zeros in unused rows and columns.
    let mut padded = Vec::new();
    if !window.is_dense() {
        padded.resize(outputs * height * pitch, T::default());
        let channels = gradient.par_chunks(window.images * window.area());
        padded.par_chunks_mut(height * pitch).zip(channels).for_each(|(out, channel)| {
            let rows = out.chunks_exact_mut(pitch).enumerate().filter(|(row, _)| window.is_row(*row));
            rows.zip(channel.chunks_exact(width)).for_each(|((_, out), row)| out[..width].copy_from_slice(row));
        });
    }
    let gradient = if window.is_dense() { gradient } else { &padded };
    let parts: Vec<Vec<T>> = x
        .par_chunks(some * area)
        .enumerate()
        .map(|(i, x)| {
            let channels = i * some..i * some + x.len() / area;
            let activation = activation.map(|affine| affine.part(channels.clone()));
            let offsets = window.offsets(channels.len(), rows);
            let mut sums = vec![T::default(); outputs * offsets.len()];
            let mut band = Vec::new();
            for first in (0..height).step_by(rows) {
                window.read(&mut band, [first, rows], x, activation);
                let range = first * pitch..height.min(first + rows) * pitch;
                let rows: Vec<&[T]> =
                    gradient.chunks_exact(height * pitch).map(|channel| &channel[range.clone()]).collect();
                T::inner(&rows, &band, &offsets, &mut sums);
            }
            sums
        })
        .collect();
    let mut out = Vec::with_capacity(outputs * all * taps);
    for output in 0..outputs {
        for part in &parts {
            let windows = part.len() / outputs;
            out.extend_from_slice(&part[output * windows..][..windows]);
        }
    }
    out
}
