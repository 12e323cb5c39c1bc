//! DenseNet-121 at 480 × 320: the work of `densenet121_480x320_*` in the peers' benchmark. `RAYON_NUM_THREADS` sets the threads.

use burn::module::Module;
use burn::tensor::{Device, Distribution, Tensor};
use divan::Bencher;
use lightoctree_nets::Adam;
use lightoctree_nets::depth::DenseNet;

#[global_allocator]
static ALLOCATOR: mimalloc::MiMalloc = mimalloc::MiMalloc;

fn main() {
    divan::main();
}

fn net_and_photo() -> (DenseNet, Tensor<4>) {
    let device = Device::flex().autodiff();
    let net = DenseNet::new(&mut random::stream(1, "bench", 0), &device);
    (net, Tensor::random([1, 3, 320, 480], Distribution::Default, &device))
}

#[divan::bench(sample_count = 10)]
fn densenet121_480x320_fwd(bencher: Bencher) {
    let (net, photo) = net_and_photo();
    let (net, photo) = (net.valid(), photo.inner());
    bencher.bench_local(|| net.forward(photo.clone()));
}

#[divan::bench(sample_count = 5)]
fn densenet121_480x320_train(bencher: Bencher) {
    let (net, photo) = net_and_photo();
    let (mut net, mut adam) = (Some(net), Adam::default());
    bencher.bench_local(|| {
        let before = net.take().expect("a network");
        let [.., features] = before.forward(photo.clone());
        let gradients = features.square().mean().backward();
        net = Some(adam.step(before, &gradients, 1e-4));
    });
}
