//! Tests the encoder against torchvision's DenseNet-121, with weights loaded by name (`golden/make_densenet.py`).

use std::collections::BTreeMap;

use burn::module::Module;
use burn::tensor::{DType, Device, Tensor, TensorData};
use lo_nets::checkpoint::Checkpoint;
use lo_nets::depth::DenseNet;
use safetensors::SafeTensors;

use crate::formula::{Golden, Wide, noise, published, weights};

const GOLDEN: &[u8] = include_bytes!("golden/densenet.safetensors");

#[test]
fn features_and_gradients_are_those_of_torchvision() {
    let golden = Golden::new(GOLDEN);
    let (_, header) = SafeTensors::read_metadata(GOLDEN).unwrap();
    let shapes: BTreeMap<String, Vec<usize>> =
        serde_json::from_str(&header.metadata().as_ref().unwrap()["shapes"]).unwrap();
    assert_eq!(shapes.len(), 604);
    let published = published(&shapes);
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

    // In f64, as in the script: f32 rounding would switch ReLUs. The remaining error is the file's f32.
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

    // The names of torchvision's first release, with one weight missing.
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
    assert_eq!(error, "the weights of \"DenseNet-121\" do not match the network: \"features.norm5.bias\" is missing");
}
