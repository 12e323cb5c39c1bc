//! Convolution of images on the CPU, fused with the preceding normalisation and activation, with gradients.
//!
//! Images are tensors `[channels, images, height, width]`. The images of a channel are contiguous, so that operations
//! by channel (normalisation, weights) have long rows, and operations by pixel need not distinguish images.

mod activation;
mod amx;
mod bands;
mod bf16;
mod depthwise;
mod kernel;
mod max_pool;
mod norm;
mod upsample;
mod window;

use burn::nn::PaddingConfig2d;
use burn::nn::conv::Conv2d;
use burn::tensor::Tensor;

use crate::conv::kernel::{ConvKernel, ThirdInput};
use crate::cpu_ops::{binary, ternary};

pub use activation::{Rectifier, activate, activated_mean, scaled};
pub use bf16::{in_bf16, in_pool};
pub use depthwise::DepthwiseKernel;
pub use max_pool::max_pool;
pub use norm::{ChannelMoments, batch_norm, group_norm};
pub use upsample::upsample_nearest;
pub use window::Window;

/// [`Conv2d::forward`] for images.
///
/// # Panics
/// With dilation, with groups other than one or one for each channel, or with different strides or paddings per axis.
pub fn conv2d(x: Tensor<4>, conv: &Conv2d) -> Tensor<4> {
    convolved(x, None, conv)
}

/// [`conv2d`] of [`activate`]`(x, affine[3, channels])` without storing the activated values, for convolutions without
/// bias.
///
/// # Panics
/// As [`conv2d`], and with a bias.
pub fn activated_conv2d(x: Tensor<4>, affine: Tensor<2>, rectifier: Rectifier, conv: &Conv2d) -> Tensor<4> {
    assert!(conv.bias.is_none(), "a convolution without bias");
    convolved(x, Some((affine, rectifier)), conv)
}

fn convolved(x: Tensor<4>, activation: Option<(Tensor<2>, Rectifier)>, conv: &Conv2d) -> Tensor<4> {
    let ([channels, images, height, width], [outputs, _, kernel, _]) = (x.dims(), conv.weight.dims());
    let PaddingConfig2d::Explicit(top, left, bottom, right) = conv.padding else {
        panic!("padding must be explicit");
    };
    let stride = conv.stride[0];
    assert!(conv.dilation == [1; 2] && conv.kernel_size == [kernel; 2], "the kernel must be square and not dilated");
    assert!(
        conv.stride == [stride; 2] && [top, bottom] == [left, right],
        "stride and padding must be equal on both axes"
    );
    let window = Window { images, ..Window::new([height, width], kernel, stride, [top, bottom]) };
    let x = x.reshape([channels, images * height * width]);
    let y = if conv.groups == 1 {
        let bias = conv.bias.as_ref().map(|bias| bias.val());
        let weights = conv.weight.val().reshape([outputs, channels * kernel * kernel]);
        let kernel = |third_input| ConvKernel { window, third_input, use_bf16: bf16::is_enabled() };
        match (activation, bias) {
            (Some((affine, rectifier)), _) => ternary(x, weights, affine, kernel(ThirdInput::Activation(rectifier))),
            (None, Some(bias)) => ternary(x, weights, bias.reshape([1, outputs]), kernel(ThirdInput::Bias)),
            (None, None) => binary(x, weights, kernel(ThirdInput::None)),
        }
    } else {
        assert!(
            conv.groups == channels && outputs == channels && conv.bias.is_none(),
            "groups must be one, or one for each channel"
        );
        let weights = conv.weight.val().reshape([channels, kernel * kernel]);
        match activation {
            Some((affine, rectifier)) => {
                ternary(x, weights, affine, DepthwiseKernel { window, rectifier: Some(rectifier) })
            }
            None => binary(x, weights, DepthwiseKernel { window, rectifier: None }),
        }
    };
    y.reshape([outputs, images, window.output[0], window.output[1]])
}

/// Reference implementation with burn's operations.
#[cfg(test)]
fn composed(
    x: Tensor<4>,
    affine: Option<Tensor<2>>,
    weights: Tensor<4>,
    bias: Option<Tensor<1>>,
    stride: usize,
    padding: usize,
) -> Tensor<4> {
    use burn::tensor::module;
    use burn::tensor::ops::ConvOptions;

    let x = match affine {
        Some(affine) => activation::composed(x, affine, activation::Epilogue::Rectify(Rectifier::Relu)),
        None => x,
    };
    let options = ConvOptions::new([stride; 2], [padding; 2], [1; 2], 1);
    module::conv2d(x.swap_dims(0, 1), weights, bias, options).swap_dims(0, 1)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cpu_ops::Kernel;
    use crate::testing::{assert_gradients, assert_same_function};

    /// Channels in and out; images, height and width; kernel, stride, padding.
    type ConvCase = ([usize; 2], [usize; 3], [usize; 3]);

    const CONV_CASES: [ConvCase; 14] = [
        ([5, 9], [1, 6, 7], [1, 1, 0]),
        ([3, 8], [1, 9, 11], [3, 1, 1]),
        ([2, 17], [1, 40, 5], [3, 1, 1]),
        ([3, 4], [1, 12, 14], [7, 2, 3]),
        ([7, 3], [1, 9, 8], [3, 2, 1]),
        ([1, 1], [1, 5, 6], [2, 1, 0]),
        ([4, 2], [1, 6, 6], [2, 3, 1]),
        ([5, 9], [3, 2, 3], [1, 1, 0]),
        ([3, 8], [4, 3, 4], [3, 1, 1]),
        ([3, 4], [2, 6, 7], [7, 2, 3]),
        ([3, 4], [3, 7, 6], [3, 2, 1]),
        ([2, 3], [3, 5, 4], [2, 2, 0]),
        ([4, 2], [2, 6, 6], [2, 3, 1]),
        ([40, 33], [2, 30, 50], [3, 1, 1]),
    ];

    const ACTIVATION: ThirdInput = ThirdInput::Activation(Rectifier::Relu);

    fn run(case: ConvCase, third: ThirdInput, inputs: &[Tensor<2>], composed_of_burn: bool) -> Tensor<2> {
        let ([channels, outputs], [images, height, width], [kernel, stride, padding]) = case;
        let [x, weights] = [0, 1].map(|i| inputs[i].clone());
        let third_input = inputs.get(2).cloned();
        if composed_of_burn {
            let x = x.reshape([channels, images, height, width]);
            let weights = weights.reshape([outputs, channels, kernel, kernel]);
            let affine = third_input.clone().filter(|_| third == ACTIVATION);
            let bias = third_input.filter(|_| third == ThirdInput::Bias).map(|bias| bias.reshape([outputs]));
            let y = composed(x, affine, weights, bias, stride, padding);
            return y.reshape([outputs as i32, -1]);
        }
        let kernel = kernel_of(case, third, false);
        match third_input {
            Some(third) => ternary(x, weights, third, kernel),
            None => binary(x, weights, kernel),
        }
    }

    fn sizes(case: ConvCase, third: ThirdInput) -> [[usize; 2]; 3] {
        let ([channels, outputs], [images, height, width], [kernel, ..]) = case;
        let third = if third == ThirdInput::Bias { [1, outputs] } else { [3, channels] };
        [[channels, images * height * width], [outputs, channels * kernel * kernel], third]
    }

    #[test]
    fn kernel_equals_reference() {
        for case in CONV_CASES {
            for third in [ACTIVATION, ThirdInput::Bias] {
                let sizes = sizes(case, third);
                assert_same_function(&sizes, |i| run(case, third, &i, false), |i| run(case, third, &i, true));
            }
            let [x, weights, _] = sizes(case, ThirdInput::None);
            let third = ThirdInput::None;
            assert_same_function(&[x, weights], |i| run(case, third, &i, false), |i| run(case, third, &i, true));
        }
    }

    #[test]
    fn gradients_equal_finite_differences() {
        for case in &CONV_CASES[..13] {
            for third in [ACTIVATION, ThirdInput::Bias] {
                assert_gradients(&sizes(*case, third), |inputs| run(*case, third, &inputs, false));
            }
        }
    }

    #[test]
    fn bf16_products_of_small_integers_are_exact() {
        for case in CONV_CASES {
            for third in [ThirdInput::None, ACTIVATION, ThirdInput::Bias] {
                let sizes = sizes(case, third);
                let sizes = if third == ThirdInput::None { &sizes[..2] } else { &sizes };
                let whole = |index: usize, [rows, columns]: [usize; 2]| -> Vec<f64> {
                    let numbers = crate::testing::values(rows * columns, 7 + index);
                    numbers.iter().map(|v| (3.0 * v).round()).collect()
                };
                let inputs: Vec<Vec<f64>> = sizes.iter().enumerate().map(|(i, &size)| whole(i, size)).collect();
                let narrow: Vec<Vec<f32>> = inputs.iter().map(|v| v.iter().map(|&v| v as f32).collect()).collect();
                let (inputs, narrow): (Vec<&[f64]>, Vec<&[f32]>) =
                    (inputs.iter().map(Vec::as_slice).collect(), narrow.iter().map(Vec::as_slice).collect());
                let kernel = |use_bf16| kernel_of(case, third, use_bf16);
                let (expected, got) = (kernel(false).forward(&inputs, sizes), kernel(true).forward(&narrow, sizes));
                assert_eq!(wide(&got), expected, "{case:?} {third:?}");
                let gradient = whole(9, kernel(false).output_size(sizes));
                let narrow_gradient: Vec<f32> = gradient.iter().map(|&v| v as f32).collect();
                let expected = kernel(false).backward(&inputs, sizes, &gradient, &[true; 3]);
                let got = kernel(true).backward(&narrow, sizes, &narrow_gradient, &[true; 3]);
                for (i, (got, expected)) in got.iter().zip(&expected).enumerate() {
                    assert_eq!(&wide(got), expected, "input {i} of {case:?} {third:?}");
                }
            }
        }
    }

    #[test]
    fn bf16_is_enabled_in_scope_only() {
        let available = amx::available();
        assert!(!bf16::is_enabled());
        let inner = in_bf16(true, || (bf16::is_enabled(), in_bf16(false, bf16::is_enabled), bf16::is_enabled()));
        assert_eq!(inner, (available, false, available));
        assert!(std::panic::catch_unwind(|| in_bf16(true, || panic!("once"))).is_err());
        assert!(!bf16::is_enabled());
        // Jobs that a pool thread starts while another job is waiting.
        assert_eq!(in_pool(|| in_bf16(true, || (in_pool(bf16::is_enabled), bf16::is_enabled()))), (false, available));
    }

    fn kernel_of(
        ([_, _], [images, height, width], [kernel, stride, padding]): ConvCase,
        third: ThirdInput,
        use_bf16: bool,
    ) -> ConvKernel {
        let window = Window { images, ..Window::new([height, width], kernel, stride, [padding; 2]) };
        ConvKernel { window, third_input: third, use_bf16 }
    }

    fn wide(numbers: &[f32]) -> Vec<f64> {
        numbers.iter().map(|&v| f64::from(v)).collect()
    }

    #[test]
    fn results_do_not_depend_on_thread_count() {
        let case = CONV_CASES[13];
        let [x, weights, affine] = sizes(case, ACTIVATION);
        let values = |[rows, columns]: [usize; 2], seed| -> Vec<f32> {
            crate::testing::values(rows * columns, seed).iter().map(|&v| v as f32).collect()
        };
        let inputs = [values(x, 1), values(weights, 2), values(affine, 3)];
        let inputs: Vec<&[f32]> = inputs.iter().map(Vec::as_slice).collect();
        for use_bf16 in [false, true] {
            let kernel = kernel_of(case, ACTIVATION, use_bf16);
            let on = |threads: usize| {
                let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
                pool.install(|| {
                    let output = kernel.forward(&inputs, &[x, weights, affine]);
                    (kernel.backward(&inputs, &[x, weights, affine], &output, &[true; 3]), output)
                })
            };
            assert!(on(1) == on(3));
        }
    }
}
