//! Counterpart of the scripts in `golden/`: weights and images by a formula, and the stored tensors.

use std::collections::BTreeMap;

use burn::module::{ModuleMapper, Param};
use burn::tensor::{DType, Tensor};
use lo_nets::checkpoint::Checkpoint;
use safetensors::SafeTensors;

/// Returns pseudo-random values in [−1, 1).
pub fn noise(name: &str, count: usize) -> Vec<f32> {
    let seed = lo_random::hash(name.as_bytes()) & 0xffff_ffff;
    let value = |i: u64| {
        let mut h = (i + seed).wrapping_mul(2_654_435_761) & 0xffff_ffff;
        h ^= h >> 15;
        h = h.wrapping_mul(2_246_822_519) & 0xffff_ffff;
        h ^= h >> 13;
        (h as f64 / f64::from(1u32 << 31) - 1.0) as f32
    };
    (0..count as u64).map(value).collect()
}

/// Returns the weights of this name.
pub fn weights(name: &str, shape: &[usize]) -> Vec<f32> {
    let x = noise(name, shape.iter().product());
    let (scale, shift) = match shape {
        [_, inputs, height, width] => ((6.0 / (inputs * height * width) as f32).sqrt(), 0.0),
        _ if name.ends_with("weight") || name.ends_with("running_var") => (0.4, 1.0),
        _ => (0.2, 0.0),
    };
    x.into_iter().map(|x| shift + scale * x).collect()
}

/// Returns all weights of a network.
pub fn published(shapes: &BTreeMap<String, Vec<usize>>) -> Checkpoint {
    let mut published = Checkpoint::default();
    for (name, shape) in shapes {
        published.insert(name, shape, weights(name, shape));
    }
    published
}

/// A file written by a script.
pub struct Golden(SafeTensors<'static>);

impl Golden {
    pub fn new(bytes: &'static [u8]) -> Self {
        Self(SafeTensors::deserialize(bytes).unwrap())
    }

    pub fn bytes(&self, name: &str) -> &[u8] {
        self.0.tensor(name).unwrap().data()
    }

    fn floats(&self, name: &str) -> Vec<f32> {
        self.bytes(name).as_chunks::<4>().0.iter().map(|&b| f32::from_le_bytes(b)).collect()
    }

    /// Asserts that a tensor equals the stored one, which may be subsampled, up to `limit` relative to its largest
    /// number.
    pub fn check<const D: usize>(&self, name: &str, got: Tensor<D>, limit: f32) {
        let (got, expected): (Vec<f32>, _) = (got.inner().into_data().iter().collect(), self.floats(name));
        let stride = got.len() / (expected.len() - 1).max(1);
        let stride = (1..=stride).rev().find(|&s| got.len().div_ceil(s) == expected.len()).unwrap();
        let largest = expected.iter().fold(0.0f32, |a, b| a.max(b.abs()));
        let errors = got.iter().step_by(stride).zip(&expected).map(|(a, b)| (a - b).abs());
        let error = errors.fold(0.0, |a, b| if b <= a { a } else { b });
        println!("{name}: {error:.2e} of {largest:.2e}");
        assert!(error <= limit * largest, "{name}: {error} of {largest}");
    }
}

/// Converts f32 parameters to f64.
pub struct Wide;

impl ModuleMapper for Wide {
    fn map_float<const D: usize>(&mut self, param: Param<Tensor<D>>) -> Param<Tensor<D>> {
        param.map(|tensor| tensor.cast(DType::F64))
    }
}
