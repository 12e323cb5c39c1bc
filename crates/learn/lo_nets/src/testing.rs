//! Test helpers: input values, comparison of two implementations, finite differences.

use burn::tensor::{DType, Device, Tensor, TensorData};

/// Returns values between −1.3 and 1.3 without a regular pattern that could hide errors.
pub fn values(count: usize, seed: usize) -> Vec<f64> {
    (0..count).map(|i| ((i * 7 + seed * 13) as f64 * 1.618).sin() + 0.3 * ((i + seed) as f64 * 0.37).cos()).collect()
}

/// Returns a device that records gradients.
pub fn recording_device() -> Device {
    Device::flex().autodiff()
}

fn inputs<const N: usize>(sizes: &[[usize; 2]; N], dtype: DType) -> [Tensor<2>; N] {
    let device = recording_device();
    std::array::from_fn(|i| {
        let data = TensorData::new(values(sizes[i][0] * sizes[i][1], i), sizes[i]);
        Tensor::<2>::from_data(data, (&device, dtype)).require_grad()
    })
}

/// Sums the output with fixed weights, so that the output's gradient has no symmetry.
fn weighted_sum(output: Tensor<2>) -> Tensor<1> {
    let size = output.dims();
    let factors = TensorData::new(values(size[0] * size[1], 91), size);
    let factors = Tensor::from_data(factors, (&output.device(), output.dtype()));
    (output * factors).sum()
}

/// Returns all values of a tensor.
pub fn numbers<const D: usize>(tensor: Tensor<D>) -> Vec<f64> {
    tensor.into_data().iter::<f64>().collect()
}

/// Returns the largest difference and the largest expected value.
pub fn difference(got: &[f64], expected: &[f64]) -> (f64, f64) {
    assert_eq!(got.len(), expected.len());
    let largest = expected.iter().fold(0.0f64, |a, b| a.max(b.abs()));
    // NaN must not count as a small difference.
    let error = got.iter().zip(expected).map(|(a, b)| (a - b).abs()).fold(0.0, |a, b| if b <= a { a } else { b });
    (error, largest)
}

/// Asserts that two functions of matrices of these sizes have equal outputs and gradients in f32.
pub fn assert_same_function<const N: usize>(
    sizes: &[[usize; 2]; N],
    got: impl Fn([Tensor<2>; N]) -> Tensor<2>,
    expected: impl Fn([Tensor<2>; N]) -> Tensor<2>,
) {
    let run = |function: &dyn Fn([Tensor<2>; N]) -> Tensor<2>| {
        let inputs = inputs(sizes, DType::F32);
        let output = function(inputs.clone());
        let gradients = weighted_sum(output.clone()).backward();
        let mut all = vec![numbers(output.inner())];
        all.extend(inputs.iter().map(|input| numbers(input.grad(&gradients).expect("a gradient"))));
        all
    };
    for (what, (got, expected)) in run(&got).iter().zip(&run(&expected)).enumerate() {
        let (error, largest) = difference(got, expected);
        // Tolerance for sums of some thousand products in f32.
        assert!(error <= 2e-5 * largest.max(1e-3), "{}: {error} of {largest}", name(what));
    }
}

fn name(what: usize) -> String {
    if what == 0 { "output".to_owned() } else { format!("gradient by input {}", what - 1) }
}

/// Asserts that gradients equal central differences, in f64.
pub fn assert_gradients<const N: usize>(sizes: &[[usize; 2]; N], function: impl Fn([Tensor<2>; N]) -> Tensor<2>) {
    const STEP: f64 = 1e-6;
    let whole = inputs(sizes, DType::F64);
    let gradients = weighted_sum(function(whole.clone())).backward();
    for (i, input) in whole.iter().enumerate() {
        let got = numbers(input.grad(&gradients).expect("a gradient"));
        let largest = got.iter().fold(0.0f64, |a, b| a.max(b.abs()));
        let point = numbers(input.clone().inner());
        for index in (0..point.len()).step_by(point.len().div_ceil(40)) {
            let at = |step: f64| {
                let mut moved = point.clone();
                moved[index] += step;
                let moved = Tensor::<2>::from_data(TensorData::new(moved, sizes[i]), (&Device::flex(), DType::F64));
                let inputs: [Tensor<2>; N] =
                    std::array::from_fn(|j| if i == j { moved.clone() } else { whole[j].clone().inner() });
                numbers(weighted_sum(function(inputs)))[0]
            };
            let expected = (at(STEP) - at(-STEP)) / (2.0 * STEP);
            let error = (got[index] - expected).abs();
            assert!(error <= 1e-5 * largest.max(1e-3), "input {i}, value {index}: {} {expected}", got[index]);
        }
    }
}
