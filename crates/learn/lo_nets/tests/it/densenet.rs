//! The encoder against torchvision's DenseNet-121, its weights loaded by name (`golden/make_densenet.py`).

use std::collections::BTreeMap;

use burn::module::{Module, ModuleMapper, Param};
use burn::tensor::{DType, Device, Tensor, TensorData};
use lo_nets::checkpoint::Checkpoint;
use lo_nets::depth::DenseNet;
use safetensors::SafeTensors;

const GOLDEN: &[u8] = include_bytes!("golden/densenet.safetensors");

/// The script's formula.
fn noise(name: &str, count: usize) -> Vec<f32> {
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

fn weights(name: &str, shape: &[usize]) -> Vec<f32> {
    let x = noise(name, shape.iter().product());
    let (scale, shift) = match shape {
        [_, inputs, height, width] => ((6.0 / (inputs * height * width) as f32).sqrt(), 0.0),
        _ if name.ends_with("weight") || name.ends_with("running_var") => (0.4, 1.0),
        _ => (0.2, 0.0),
    };
    x.into_iter().map(|x| shift + scale * x).collect()
}

struct Golden(SafeTensors<'static>);

impl Golden {
    fn floats(&self, name: &str) -> Vec<f32> {
        let bytes = self.0.tensor(name).unwrap().data();
        bytes.as_chunks::<4>().0.iter().map(|&b| f32::from_le_bytes(b)).collect()
    }

    fn check<const D: usize>(&self, name: &str, got: Tensor<D>, limit: f32) {
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

/// f32 to f64.
struct Wide;

impl ModuleMapper for Wide {
    fn map_float<const D: usize>(&mut self, param: Param<Tensor<D>>) -> Param<Tensor<D>> {
        param.map(|tensor| tensor.cast(DType::F64))
    }
}

#[test]
fn features_and_gradients_are_those_of_torchvision() {
    let golden = Golden(SafeTensors::deserialize(GOLDEN).unwrap());
    let (_, header) = SafeTensors::read_metadata(GOLDEN).unwrap();
    let shapes: BTreeMap<String, Vec<usize>> =
        serde_json::from_str(&header.metadata().as_ref().unwrap()["shapes"]).unwrap();
    assert_eq!(shapes.len(), 604);
    let mut published = Checkpoint::default();
    for (name, shape) in &shapes {
        published.insert(name, shape, weights(name, shape));
    }
    let device = Device::flex().autodiff();
    let fresh = || DenseNet::new(&mut lo_random::stream(1, "test", 0), &device);
    let net = fresh().load_torchvision(&published).unwrap();
    let photo =
        |device: &Device| Tensor::<4>::from_data(TensorData::new(noise("photo", 3 * 64 * 96), [3, 1, 64, 96]), device);
    for (i, features) in net.valid().forward(photo(&Device::flex())).into_iter().enumerate() {
        golden.check(&format!("eval.{i}"), features, 1e-4);
    }
    let [.., last] = net.forward(photo(&device));
    golden.check("train.4", last, 1e-4);

    // f64, for the reason that the script gives; what is left is the f32 of the file.
    let net = fresh().load_torchvision(&published).unwrap().valid().map(&mut Wide).train();
    let [.., last] = net.forward(photo(&device).cast(DType::F64));
    let gradient = TensorData::new(noise("gradient", last.dims().iter().product()), last.dims());
    let gradients = (last.clone() * Tensor::from_data(gradient, (&device, DType::F64))).sum().backward();
    golden.check("train.4", last, 1e-6);
    let gradient = |name: &str, tensor: Tensor<4>| golden.check(&format!("gradient.{name}"), tensor, 1e-6);
    gradient("conv0.weight", net.conv0.weight.grad(&gradients).unwrap());
    gradient("denseblock4.denselayer16.conv2.weight", net.blocks[3].layers[15].conv2.weight.grad(&gradients).unwrap());
    gradient("transition3.conv.weight", net.transitions[2].conv.weight.grad(&gradients).unwrap());
    let norm = &net.blocks[1].layers[2].norm1;
    golden.check("gradient.denseblock2.denselayer3.norm1.weight", norm.gamma.grad(&gradients).unwrap(), 1e-6);
    let norm = &net.valid().blocks[2].layers[4].norm2;
    golden.check("running_mean", norm.running_mean.value_sync(), 1e-6);
    golden.check("running_var", norm.running_var.value_sync(), 1e-6);

    // The names of torchvision's first release, and a weight that is not there.
    let mut old = Checkpoint::default();
    for (name, shape) in &shapes {
        let old_name = ["norm1", "norm2", "conv1", "conv2"].iter().fold(name.clone(), |name, part| {
            name.replace(&format!(".{part}."), &format!(".{}.{}.", &part[..4], &part[4..]))
        });
        if old_name != "features.norm5.bias" {
            old.insert(&old_name, shape, weights(name, shape));
        }
    }
    let error = fresh().load_torchvision(&old).unwrap_err().to_string();
    assert_eq!(error, "the weights of \"DenseNet-121\" do not fit: \"features.norm5.bias\" is missing");
}
