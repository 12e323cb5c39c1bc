use std::ops::Range;

use burn::tensor::Tensor;
use pulp::{Arch, Simd, WithSimd};
use rayon::prelude::*;

use crate::cpu_ops::{Kernel, Number, binary, zeros};
use crate::gemm::LANES;

/// Returns `scale · (x − centre) + shift`. These are the rows of `affine`: `[3, channels]`, or `[3, channels · images]`
/// for separate values of each image.
pub fn scaled(x: Tensor<4>, affine: Tensor<2>) -> Tensor<4> {
    apply(x, affine, Epilogue::None)
}

/// Rectifying activation.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Rectifier {
    /// max(x, 0).
    Relu,
    /// min(max(x, 0), 6) (Krizhevsky 2010).
    Relu6,
}

impl Rectifier {
    fn ceiling(self) -> f64 {
        match self {
            Self::Relu => f64::INFINITY,
            Self::Relu6 => 6.0,
        }
    }
}

/// Applies [`scaled`], then the rectifier.
pub fn activate(x: Tensor<4>, affine: Tensor<2>, rectifier: Rectifier) -> Tensor<4> {
    apply(x, affine, Epilogue::Rectify(rectifier))
}

/// Applies [`scaled`], ReLU and the mean over 2 × 2 pixels: `[channels, images, height / 2, width / 2]`.
///
/// # Panics
/// Where height or width is odd.
pub fn activated_mean(x: Tensor<4>, affine: Tensor<2>) -> Tensor<4> {
    apply(x, affine, Epilogue::ReluMean)
}

fn apply(x: Tensor<4>, affine: Tensor<2>, epilogue: Epilogue) -> Tensor<4> {
    let [channels, images, height, width] = x.dims();
    let [_, rows] = affine.dims();
    assert!(epilogue != Epilogue::ReluMean || height.is_multiple_of(2), "an even height");
    let kernel = ActivationKernel { width, epilogue };
    let y = binary(x.reshape([rows, channels * images * height * width / rows.max(1)]), affine, kernel);
    let halved = usize::from(epilogue == Epilogue::ReluMean);
    y.reshape([channels, images, height >> halved, width >> halved])
}

/// Reference implementation with burn's operations.
#[cfg(test)]
pub(super) fn composed(x: Tensor<4>, affine: Tensor<2>, epilogue: Epilogue) -> Tensor<4> {
    use burn::tensor::ops::AvgPoolOptions;
    use burn::tensor::{activation::relu, module::avg_pool2d};

    let ([channels, ..], [_, rows]) = (x.dims(), affine.dims());
    let row = |row| affine.clone().narrow(0, row, 1).reshape([channels, rows / channels, 1, 1]);
    let [scale, centre, shift] = [0, 1, 2].map(row);
    let y = (x - centre) * scale + shift;
    match epilogue {
        Epilogue::None => y,
        Epilogue::Rectify(Rectifier::Relu) => relu(y),
        Epilogue::Rectify(Rectifier::Relu6) => y.clamp(0.0, 6.0),
        Epilogue::ReluMean => avg_pool2d(relu(y), AvgPoolOptions::new([2, 2])),
    }
}

/// `scale · (x − centre) + shift` on slices. Gradients sum products with x − centre: sums with x alone would lose
/// precision by cancellation where the mean is large.
#[derive(Clone, Copy, Debug)]
pub(super) struct Affine<'a, T> {
    scale: &'a [T],
    centre: &'a [T],
    shift: &'a [T],
    /// Upper limit of the rectifier.
    ceiling: T,
}

/// [`Affine`] for a single channel.
#[derive(Clone, Copy, Debug)]
pub(super) struct ChannelAffine<T> {
    scale: T,
    centre: T,
    /// Shift of `scale · x`, with the centre folded in.
    shift: T,
    ceiling: T,
}

impl<'a, T: Number> Affine<'a, T> {
    /// Borrows the rows of `[3, channels]`.
    pub fn new(rows: &'a [T], rectifier: Rectifier) -> Self {
        let (scale, rest) = rows.split_at(rows.len() / 3);
        let (centre, shift) = rest.split_at(rest.len() / 2);
        Self { scale, centre, shift, ceiling: T::from_f64(rectifier.ceiling()) }
    }

    /// Restricts to a range of channels.
    pub fn part(&self, channels: Range<usize>) -> Self {
        let [scale, centre, shift] = [self.scale, self.centre, self.shift].map(|row| &row[channels.clone()]);
        Self { scale, centre, shift, ceiling: self.ceiling }
    }

    pub fn channel(&self, channel: usize) -> ChannelAffine<T> {
        let (scale, centre) = (self.scale[channel], self.centre[channel]);
        ChannelAffine { scale, centre, shift: self.shift[channel] - scale * centre, ceiling: self.ceiling }
    }
}

impl<T: Number> ChannelAffine<T> {
    #[inline(always)]
    pub fn value(&self, x: T) -> T {
        self.scale * x + self.shift
    }

    /// Keeps NaN, so that it is noticed.
    #[inline(always)]
    pub fn rectified(&self, x: T) -> T {
        let value = self.value(x);
        let value = if value < T::default() { T::default() } else { value };
        if value > self.ceiling { self.ceiling } else { value }
    }

    /// Reports whether [`ChannelAffine::rectified`] depends on x. Uses the same operations, so that both agree.
    #[inline(always)]
    fn is_active(&self, x: T) -> bool {
        let value = self.value(x);
        value > T::default() && value < self.ceiling
    }
}

/// Operation fused behind scale and shift.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Epilogue {
    None,
    Rectify(Rectifier),
    /// ReLU, then the mean over 2 × 2 pixels.
    ReluMean,
}

impl Epilogue {
    fn rectifier(self) -> Rectifier {
        if let Self::Rectify(rectifier) = self { rectifier } else { Rectifier::Relu }
    }
}

/// [`apply`] on slices.
#[derive(Clone, Copy, Debug)]
struct ActivationKernel {
    width: usize,
    epilogue: Epilogue,
}

impl Kernel for ActivationKernel {
    fn output_size(&self, sizes: &[[usize; 2]]) -> [usize; 2] {
        let [channels, area] = sizes[0];
        assert_eq!(sizes[1], [3, channels], "a scale, a centre and a shift for each channel");
        if self.epilogue != Epilogue::ReluMean {
            return [channels, area];
        }
        assert!(self.width.is_multiple_of(2) && area.is_multiple_of(2 * self.width), "an even height and width");
        [channels, area / 4]
    }

    fn forward<T: Number>(&self, inputs: &[&[T]], sizes: &[[usize; 2]]) -> Vec<T> {
        let [channels, out_area] = self.output_size(sizes);
        let affine = Affine::new(inputs[1], self.epilogue.rectifier());
        let mut out = zeros(channels * out_area);
        let rows = out.par_chunks_mut(out_area.max(1)).zip(inputs[0].par_chunks(sizes[0][1].max(1)));
        rows.enumerate().for_each(|(channel, (out, x))| {
            Arch::new().dispatch(Activate { out, x, affine: affine.channel(channel), kernel: *self });
        });
        out
    }

    fn backward<T: Number>(&self, inputs: &[&[T]], _: &[[usize; 2]], gradient: &[T], _: &[bool]) -> Vec<Vec<T>> {
        let mut by_x = match self.epilogue {
            Epilogue::ReluMean => spread_quarters(gradient, self.width / 2),
            _ => gradient.to_vec(),
        };
        let by_affine = activation_backward(
            &mut by_x,
            inputs[0],
            Affine::new(inputs[1], self.epilogue.rectifier()),
            self.epilogue != Epilogue::None,
        );
        vec![by_x, by_affine]
    }
}

/// One channel of [`apply`].
struct Activate<'a, T> {
    out: &'a mut [T],
    x: &'a [T],
    affine: ChannelAffine<T>,
    kernel: ActivationKernel,
}

impl<T: Number> WithSimd for Activate<'_, T> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        let Self { out, x, affine, kernel: ActivationKernel { width, epilogue } } = self;
        let value = |x: T| affine.rectified(x);
        match epilogue {
            Epilogue::None => out.iter_mut().zip(x).for_each(|(out, &x)| *out = affine.value(x)),
            Epilogue::Rectify(_) => out.iter_mut().zip(x).for_each(|(out, &x)| *out = value(x)),
            Epilogue::ReluMean => {
                let quarter = T::from_f64(0.25);
                for (out, rows) in out.chunks_exact_mut(width / 2).zip(x.chunks_exact(2 * width)) {
                    let (upper, lower) = rows.split_at(width);
                    let pairs = upper.as_chunks::<2>().0.iter().zip(lower.as_chunks::<2>().0);
                    for (out, (upper, lower)) in out.iter_mut().zip(pairs) {
                        *out = (value(upper[0]) + value(upper[1]) + (value(lower[0]) + value(lower[1]))) * quarter;
                    }
                }
            }
        }
    }
}

/// Distributes each value equally to 2 × 2 pixels. `width` is that of `gradient`'s rows.
fn spread_quarters<T: Number>(gradient: &[T], width: usize) -> Vec<T> {
    let quarter = T::from_f64(0.25);
    let mut out = zeros(4 * gradient.len());
    out.par_chunks_mut(4 * width).zip(gradient.par_chunks(width)).for_each(|(rows, gradient)| {
        let (upper, lower) = rows.split_at_mut(2 * width);
        for (pair, &gradient) in upper.as_chunks_mut::<2>().0.iter_mut().zip(gradient) {
            *pair = [gradient * quarter; 2];
        }
        lower.copy_from_slice(upper);
    });
    out
}

/// Backpropagates through [`Affine`] and an optional rectifier. Replaces the output's gradient by that of x, and
/// returns that of the affine's rows.
pub(super) fn activation_backward<T: Number>(
    gradient: &mut [T],
    x: &[T],
    affine: Affine<T>,
    rectified: bool,
) -> Vec<T> {
    let area = (x.len() / affine.scale.len()).max(1);
    let sums: Vec<[f64; 3]> = gradient
        .par_chunks_mut(area)
        .zip(x.par_chunks(area))
        .enumerate()
        .map(|(channel, (gradient, x))| {
            Arch::new().dispatch(ActivationBackward { gradient, x, affine: affine.channel(channel), rectified })
        })
        .collect();
    (0..3).flat_map(|i| sums.iter().map(move |sums| T::from_f64(sums[i]))).collect()
}

/// One channel of [`activation_backward`].
struct ActivationBackward<'a, T> {
    gradient: &'a mut [T],
    x: &'a [T],
    affine: ChannelAffine<T>,
    rectified: bool,
}

impl<T: Number> WithSimd for ActivationBackward<'_, T> {
    /// Gradients of scale, centre and shift.
    type Output = [f64; 3];

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) -> [f64; 3] {
        let Self { gradient, x, affine, rectified } = self;
        let step = |gradient: &mut T, x: T, [by_scale, by_shift]: [&mut T; 2]| {
            let active = !rectified || affine.is_active(x);
            let inner = if active { *gradient } else { T::default() };
            *by_scale += inner * (x - affine.centre);
            *by_shift += inner;
            *gradient = affine.scale * inner;
        };
        let mut sums = [[T::default(); LANES]; 2];
        let [scale_sums, shift_sums] = &mut sums;
        let ((chunks, rest), (x, x_rest)) = (gradient.as_chunks_mut::<LANES>(), x.as_chunks::<LANES>());
        for (gradient, x) in chunks.iter_mut().zip(x) {
            for i in 0..LANES {
                step(&mut gradient[i], x[i], [&mut scale_sums[i], &mut shift_sums[i]]);
            }
        }
        for (i, (gradient, &x)) in rest.iter_mut().zip(x_rest).enumerate() {
            step(gradient, x, [&mut scale_sums[i], &mut shift_sums[i]]);
        }
        let [by_scale, by_shift] = sums.map(|sums| sums.iter().map(|sum| sum.as_f64()).sum::<f64>());
        [by_scale, -affine.scale.as_f64() * by_shift, by_shift]
    }
}

/// Sums in a fixed, vectorisable order.
#[inline(always)]
pub(super) fn total<T: Number>(row: &[T]) -> f64 {
    let (chunks, rest) = row.as_chunks::<LANES>();
    let mut sums = [T::default(); LANES];
    for chunk in chunks {
        sums.iter_mut().zip(chunk).for_each(|(sum, &value)| *sum += value);
    }
    sums.iter().chain(rest).map(|sum| sum.as_f64()).sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{assert_gradients, assert_same_function};

    /// Five channels of two images, with values for each channel and for each image.
    const SIZES: [[[usize; 2]; 2]; 2] = [[[5, 2 * 6 * 8], [3, 5]], [[5, 2 * 6 * 8], [3, 10]]];

    const ALL: [Epilogue; 4] =
        [Epilogue::None, Epilogue::Rectify(Rectifier::Relu), Epilogue::Rectify(Rectifier::Relu6), Epilogue::ReluMean];

    /// Scales so that some values exceed 6.
    fn large(affine: Tensor<2>) -> Tensor<2> {
        4.0 * affine
    }

    fn on_images(x: Tensor<2>, function: impl Fn(Tensor<4>) -> Tensor<4>) -> Tensor<2> {
        let channels = x.dims()[0];
        function(x.reshape([channels, 2, 6, 8])).flatten(0, 2)
    }

    #[test]
    fn kernel_equals_reference() {
        for epilogue in ALL {
            for sizes in SIZES {
                assert_same_function(
                    &sizes,
                    |[x, a]| on_images(x, |x| apply(x, large(a.clone()), epilogue)),
                    |[x, a]| on_images(x, |x| composed(x, large(a.clone()), epilogue)),
                );
            }
        }
    }

    #[test]
    fn gradients_equal_finite_differences() {
        for epilogue in ALL {
            for sizes in SIZES {
                assert_gradients(&sizes, |[x, a]| on_images(x, |x| apply(x, large(a.clone()), epilogue)));
            }
        }
    }
}
