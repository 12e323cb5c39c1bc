//! Tests the encoder against the package `efficientnet_lite_pytorch`, with weights loaded by name
//! (`golden/make_efficientnet.py`).

use std::collections::BTreeMap;

use burn::module::Module;
use burn::tensor::{DType, Device, Tensor, TensorData};
use lo_nets::depth::{EfficientNetLite, EfficientNetScale};
use safetensors::SafeTensors;

use crate::formula::{Golden, Wide, noise, published};

const GOLDEN: &[u8] = include_bytes!("golden/efficientnet.safetensors");

#[test]
fn features_and_gradients_are_those_of_the_package() {
    let golden = Golden::new(GOLDEN);
    let (_, header) = SafeTensors::read_metadata(GOLDEN).unwrap();
    let shapes: BTreeMap<String, BTreeMap<String, Vec<usize>>> =
        serde_json::from_str(&header.metadata().as_ref().unwrap()["shapes"]).unwrap();
    let device = Device::flex().autodiff();
    for (name, scale, blocks) in
        [("efficientnet-lite0", EfficientNetScale::LITE0, 16), ("efficientnet-lite2", EfficientNetScale::LITE2, 21)]
    {
        // A convolution and four norm tensors for each layer; the first block has no expansion.
        assert_eq!(shapes[name].len(), 5 * (1 + 3 * blocks - 1));
        let published = published(&shapes[name]);
        let fresh = || EfficientNetLite::new(scale, &mut lo_random::stream(1, "test", 0), &device);
        let net = fresh().load_published(&published).unwrap();
        let photo = |device: &Device| {
            // The script has images first, then channels.
            let data = TensorData::new(noise("photo", 2 * 3 * 64 * 96), [2, 3, 64, 96]);
            Tensor::<4>::from_data(data, device).swap_dims(0, 1)
        };
        let check = |what: &str, got: Tensor<4>, limit| {
            golden.check(&format!("{name}.{what}"), got.swap_dims(0, 1), limit);
        };
        for (i, features) in net.valid().forward(photo(&Device::flex())).into_iter().enumerate() {
            check(&format!("eval.{i}"), features, 1e-4);
        }

        // In f64, as in the script: f32 rounding would switch ReLUs. The remaining error is the file's f32.
        let net = fresh().load_published(&published).unwrap().valid().map(&mut Wide).train();
        let [.., last] = net.forward(photo(&device).cast(DType::F64));
        let [channels, _, height, width] = last.dims();
        let gradient = TensorData::new(noise("gradient", 2 * channels * height * width), [2, channels, height, width]);
        let gradient = Tensor::<4>::from_data(gradient, (&device, DType::F64)).swap_dims(0, 1);
        let gradients = (last.clone() * gradient).sum().backward();
        check("train.4", last, 1e-6);
        let [third, twelfth] = [2, 11].map(|index| &net.blocks[index]);
        let of = |what: &str| format!("{name}.gradient.{what}");
        golden.check(&of("_conv_stem.weight"), net.stem.conv.weight.grad(&gradients).unwrap(), 1e-6);
        let depthwise = net.first.depthwise.conv.weight.grad(&gradients).unwrap();
        golden.check(&of("_blocks.0._depthwise_conv.weight"), depthwise, 1e-6);
        let depthwise = third.reduce.depthwise.conv.weight.grad(&gradients).unwrap();
        golden.check(&of("_blocks.3._depthwise_conv.weight"), depthwise, 1e-6);
        golden.check(&of("_blocks.3._expand_conv.weight"), third.expand.conv.weight.grad(&gradients).unwrap(), 1e-6);
        let gamma = twelfth.reduce.depthwise.norm.gamma.grad(&gradients).unwrap();
        golden.check(&of("_blocks.12._bn1.weight"), gamma, 1e-6);
        let norm = &net.valid().blocks[6].reduce.depthwise.norm;
        golden.check(&format!("{name}.running_mean"), norm.running_mean.value_sync(), 1e-6);
        golden.check(&format!("{name}.running_var"), norm.running_var.value_sync(), 1e-6);
    }
}
