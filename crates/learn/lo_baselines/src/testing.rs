//! Test helpers: training examples of a known room, and finite differences.

use burn::tensor::{DType, Device, Tensor};
use lo_geometry::{Vec3, pixel_direction};
use lo_imaging::{DepthMap, RadianceImage};

use crate::example::{BaselineExample, PANORAMA, PROBE_MAP, Probe};
use crate::features::{FeatureShape, PhotoFeatures};
use crate::planes::Planes;

/// Small features.
pub(crate) const SHAPE: FeatureShape = FeatureShape { eighth: 8, sixteenth: 12, last: 16, global: 9 };

/// Returns the device that records gradients.
pub(crate) fn recording_device() -> Device {
    Device::flex().autodiff()
}

/// Returns values between −1.3 and 1.3 without a regular pattern.
pub(crate) fn values(count: usize, seed: usize) -> Vec<f32> {
    let at = |i: usize| ((i * 7 + seed * 13) as f64 * 1.618).sin() + 0.3 * ((i + seed) as f64 * 0.37).cos();
    (0..count).map(|i| at(i) as f32).collect()
}

/// Returns all values of a tensor.
pub(crate) fn numbers<const D: usize>(tensor: Tensor<D>) -> Vec<f32> {
    tensor.into_data().convert::<f32>().iter().collect()
}

/// Asserts that the gradient of a scalar function equals central differences, in f64.
pub(crate) fn assert_gradient<const D: usize>(at: Tensor<D>, function: impl Fn(Tensor<D>) -> Tensor<1>) {
    const STEP: f64 = 1e-6;
    let dims = at.dims();
    let point: Vec<f64> = at.into_data().convert::<f64>().iter().collect();
    let tensor = |values: Vec<f64>, device: &Device| {
        Tensor::<D>::from_data(burn::tensor::TensorData::new(values, dims), (device, DType::F64))
    };
    let x = tensor(point.clone(), &recording_device()).require_grad();
    let gradients = function(x.clone()).backward();
    let got: Vec<f64> = x.grad(&gradients).expect("a gradient").into_data().convert::<f64>().iter().collect();
    let largest = got.iter().fold(0.0f64, |a, b| a.max(b.abs()));
    for i in (0..point.len()).step_by(point.len().div_ceil(30)) {
        let moved = |step: f64| {
            let mut values = point.clone();
            values[i] += step;
            let value: Vec<f64> =
                function(tensor(values, &Device::flex())).into_data().convert::<f64>().iter().collect();
            value[0]
        };
        let expected = (moved(STEP) - moved(-STEP)) / (2.0 * STEP);
        assert!((got[i] - expected).abs() <= 1e-4 * largest.max(1e-3), "{i}: {} {expected}", got[i]);
    }
}

/// Returns a light: dim, with a lamp towards +X whose brightness differs by photo.
pub(crate) fn lit(lamp: f32, [width, height]: [usize; 2]) -> RadianceImage {
    RadianceImage::from_fn(width, height, |x, y| {
        let d = pixel_direction(x, y, width, height);
        let value = 0.3 + 0.1 * d.y + if d.x > 0.9 { lamp } else { 0.0 };
        [value, 0.9 * value, 0.7 * value]
    })
}

/// Returns a training example of a photo of 64 × 32 pixels, with probes at two cells.
pub(crate) fn example(number: usize) -> BaselineExample {
    let planes =
        |size: [usize; 3], seed: usize| Planes { size, values: values(size.iter().product(), seed + 31 * number) };
    let mut global = values(SHAPE.global, number);
    global[SHAPE.global - 3..].copy_from_slice(&[-1.0, -1.1, -1.3]);
    let lamp = 2.0 + number as f32;
    let probe = |column: usize| Probe {
        cell: [1, column],
        position_m: Vec3::new(column as f32, 0.0, -2.0),
        radiance: lit(lamp * (1.0 + column as f32), PROBE_MAP),
        distance_m: DepthMap::from_fn(PROBE_MAP[0], PROBE_MAP[1], |x, _| 1.0 + x as f32 / 16.0),
    };
    BaselineExample {
        features: PhotoFeatures {
            eighth: planes([SHAPE.eighth, 4, 8], 1),
            sixteenth: planes([SHAPE.sixteenth, 2, 4], 2),
            last: planes([SHAPE.last, 1, 2], 3),
            photo: Planes::from_fn([3, 4, 8], |c, y, x| 0.1 * (c + y) as f32 + 0.02 * x as f32),
            points_m: Planes::from_fn([3, 4, 8], |_, y, _| 2.0 + y as f32),
            global,
            shown: [4, 8],
        },
        panorama: lit(lamp, PANORAMA),
        albedo: Planes::from_fn([3, 4, 8], |c, _, x| 0.2 + 0.1 * c as f32 + 0.05 * x as f32),
        normal: Planes::from_fn([3, 4, 8], |c, y, _| if c == 2 && y > 0 { 1.0 } else { 0.0 }),
        probes: vec![probe(1), probe(5)],
    }
}
