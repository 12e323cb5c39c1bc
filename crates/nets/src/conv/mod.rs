//! Convolution of pictures on the CPU, with the normalisation and activation before it, and its gradients.
//!
//! Pictures are tensors `[channels, pictures, height, width]`: of a channel all pictures lie one after the other, so that what goes by channels
//! (normalisation, weights) meets long rows, and what goes by pixels need not know which picture they are of.

mod activation;
mod doubled;
mod kernel;
mod max_pool;
mod norm;
mod sums;
mod window;

use burn::nn::PaddingConfig2d;
use burn::nn::conv::Conv2d;
use burn::tensor::ops::ConvOptions;
use burn::tensor::{Tensor, module};

use crate::conv::kernel::{ConvKernel, Third};
use crate::conv::window::Window;
use crate::host::{binary, has_kernels, ternary};

pub use activation::{activate, activated_mean, scaled};
pub use doubled::doubled;
pub use max_pool::max_pool;
pub use norm::{Moments, batch_norm, group_norm};
pub use sums::Sums;

/// [`Conv2d::forward`] of pictures.
///
/// # Panics
/// For dilation, groups, or another stride or padding down than across.
pub fn conv2d(x: Tensor<4>, conv: &Conv2d) -> Tensor<4> {
    convolved(x, None, conv)
}

/// [`conv2d`] of what [`activate`] makes of `x` and `affine[3, channels]`, which is never stored, for a convolution without bias.
///
/// # Panics
/// As [`conv2d`], and for a convolution with a bias.
pub fn activated_conv2d(x: Tensor<4>, affine: Tensor<2>, conv: &Conv2d) -> Tensor<4> {
    assert!(conv.bias.is_none(), "a convolution without bias");
    convolved(x, Some(affine), conv)
}

fn convolved(x: Tensor<4>, affine: Option<Tensor<2>>, conv: &Conv2d) -> Tensor<4> {
    let ([channels, pictures, height, width], [outputs, _, kernel, _]) = (x.dims(), conv.weight.dims());
    let PaddingConfig2d::Explicit(padding, bottom, left, right) = conv.padding else {
        panic!("padding in numbers of pixels");
    };
    let stride = conv.stride[0];
    assert!(
        conv.groups == 1 && conv.dilation == [1; 2] && conv.kernel_size == [kernel; 2],
        "no groups, no dilation, a square kernel"
    );
    assert!(
        conv.stride == [stride; 2] && [bottom, left, right] == [padding; 3],
        "the same stride and padding all round"
    );
    let bias = conv.bias.as_ref().map(|bias| bias.val());
    if !has_kernels(&x) {
        return composed(x, affine, conv.weight.val(), bias, stride, padding);
    }
    let window = Window { pictures, ..Window::new([height, width], kernel, stride, padding) };
    let x = x.reshape([channels, pictures * height * width]);
    let weights = conv.weight.val().reshape([outputs, channels * kernel * kernel]);
    let kernel = |third| ConvKernel { window, third };
    let y = match (affine, bias) {
        (Some(affine), _) => ternary(x, weights, affine, kernel(Third::Activation)),
        (None, Some(bias)) => ternary(x, weights, bias.reshape([1, outputs]), kernel(Third::Bias)),
        (None, None) => binary(x, weights, kernel(Third::None)),
    };
    y.reshape([outputs, pictures, window.output[0], window.output[1]])
}

/// The same by burn's own operations: for backends without kernels, and to check them.
fn composed(
    x: Tensor<4>,
    affine: Option<Tensor<2>>,
    weights: Tensor<4>,
    bias: Option<Tensor<1>>,
    stride: usize,
    padding: usize,
) -> Tensor<4> {
    let x = match affine {
        Some(affine) => activation::composed(x, affine, activation::Then::Positive),
        None => x,
    };
    let options = ConvOptions::new([stride; 2], [padding; 2], [1; 2], 1);
    module::conv2d(x.swap_dims(0, 1), weights, bias, options).swap_dims(0, 1)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::host::Kernel;
    use crate::testing::{assert_gradients, assert_same_function};

    /// Channels in and out; pictures, height and width; kernel, stride, padding.
    type Case = ([usize; 2], [usize; 3], [usize; 3]);

    const CASES: [Case; 14] = [
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

    fn run(case: Case, third: Third, inputs: &[Tensor<2>], composed_of_burn: bool) -> Tensor<2> {
        let ([channels, outputs], [pictures, height, width], [kernel, stride, padding]) = case;
        let window = Window { pictures, ..Window::new([height, width], kernel, stride, padding) };
        let [x, weights] = [0, 1].map(|i| inputs[i].clone());
        let third_input = inputs.get(2).cloned();
        if composed_of_burn {
            let x = x.reshape([channels, pictures, height, width]);
            let weights = weights.reshape([outputs, channels, kernel, kernel]);
            let affine = third_input.clone().filter(|_| third == Third::Activation);
            let bias = third_input.filter(|_| third == Third::Bias).map(|bias| bias.reshape([outputs]));
            return composed(x, affine, weights, bias, stride, padding).reshape([outputs, pictures * window.area()]);
        }
        let kernel = ConvKernel { window, third };
        match third_input {
            Some(third) => ternary(x, weights, third, kernel),
            None => binary(x, weights, kernel),
        }
    }

    fn sizes(case: Case, third: Third) -> [[usize; 2]; 3] {
        let ([channels, outputs], [pictures, height, width], [kernel, ..]) = case;
        let third = if third == Third::Bias { [1, outputs] } else { [3, channels] };
        [[channels, pictures * height * width], [outputs, channels * kernel * kernel], third]
    }

    #[test]
    fn kernel_is_the_composition() {
        for case in CASES {
            for third in [Third::Activation, Third::Bias] {
                let sizes = sizes(case, third);
                assert_same_function(&sizes, |i| run(case, third, &i, false), |i| run(case, third, &i, true));
            }
            let [x, weights, _] = sizes(case, Third::None);
            let third = Third::None;
            assert_same_function(&[x, weights], |i| run(case, third, &i, false), |i| run(case, third, &i, true));
        }
    }

    #[test]
    fn gradients_are_differences() {
        for case in &CASES[..13] {
            for third in [Third::Activation, Third::Bias] {
                assert_gradients(&sizes(*case, third), |inputs| run(*case, third, &inputs, false));
            }
        }
    }

    #[test]
    fn threads_do_not_change_a_bit() {
        let case = CASES[13];
        let [x, weights, affine] = sizes(case, Third::Activation);
        let values = |[rows, columns]: [usize; 2], seed| -> Vec<f32> {
            crate::testing::values(rows * columns, seed).iter().map(|&v| v as f32).collect()
        };
        let inputs = [values(x, 1), values(weights, 2), values(affine, 3)];
        let inputs: Vec<&[f32]> = inputs.iter().map(Vec::as_slice).collect();
        let ([pictures, height, width], [kernel, stride, padding]) = (case.1, case.2);
        let window = Window { pictures, ..Window::new([height, width], kernel, stride, padding) };
        let kernel = ConvKernel { window, third: Third::Activation };
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
