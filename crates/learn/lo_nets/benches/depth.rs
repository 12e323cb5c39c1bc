//! DenseNet-121 at 480 × 320, the work of `densenet121_480x320_*` in the peers' benchmark, and the whole depth network.
//!
//! `RAYON_NUM_THREADS` sets the threads. `MIMALLOC_PURGE_DELAY=100000` keeps memory between the steps as the peers' `--tuned` does;
//! `MIMALLOC_SHOW_STATS=1` prints the peak.

use burn::module::Module;
use burn::tensor::{Device, Distribution, Tensor};
use divan::Bencher;
use lo_imaging::{DepthMap, Image, RadianceImage};
use lo_nets::Adam;
use lo_nets::conv::in_bf16;
use lo_nets::depth::{DenseNet, DepthNet, EncoderKind, PatchGan, depth_losses, panorama_loss};

#[global_allocator]
static ALLOCATOR: mimalloc::MiMalloc = mimalloc::MiMalloc;

fn main() {
    // On one of rayon's threads: from another, each of some thousand small parallel loops waits for one of them to wake up.
    rayon::scope(|_| divan::main());
}

fn net_and_photo() -> (DenseNet, Tensor<4>) {
    let device = Device::flex().autodiff();
    let net = DenseNet::new(&mut lo_random::stream(1, "bench", 0), &device);
    (net, Tensor::random([3, 1, 320, 480], Distribution::Default, &device))
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

fn photo() -> Image<[u8; 3]> {
    Image::from_fn(480, 320, |x, y| [x as u8, y as u8, (x / 8 + y / 8) as u8])
}

/// Depth and the global lighting feature.
#[divan::bench(sample_count = 10)]
fn depth_net_fwd(bencher: Bencher) {
    let (net, photo) = (DepthNet::new(EncoderKind::default(), 64, 1, &Device::flex()), photo());
    bencher.bench_local(|| net.forward(&[&photo]));
}

/// All losses, a step of the network and one of the discriminator; in f32, and with bf16 products.
#[divan::bench(sample_count = 5, args = [false, true])]
fn depth_net_train(bencher: Bencher, bf16: bool) {
    let (device, photo) = (Device::flex().autodiff(), photo());
    let mut nets = Some((DepthNet::new(EncoderKind::default(), 64, 1, &device), PatchGan::new(2, &device)));
    let (mut adam, mut judge_adam) = (Adam::default(), Adam::default());
    let truth = DepthMap::from_fn(480, 320, |x, y| 1.0 + 0.01 * (x + y) as f32);
    let sky = RadianceImage::from_fn(128, 64, |_, y| [if y < 20 { 8.0 } else { 0.2 }; 3]);
    let condition = Tensor::<4>::ones([4, 1, 64, 128], &device);
    let real = Tensor::<4>::ones([3, 1, 64, 128], &device);
    let mut step = || {
        let (net, judge) = nets.take().expect("networks");
        let output = net.forward(&[&photo]);
        let [log_depth, _, variance] = depth_losses(output.log_extent, &[&truth]);
        let made = net.panorama.forward(output.global);
        let opinion = judge.generator_loss(made.clone(), condition.clone());
        let loss = log_depth + variance + panorama_loss(made.clone(), &[&sky]) + opinion;
        let net = adam.step(net, &loss.backward(), 1e-4);
        let loss = judge.discriminator_loss(real.clone(), made, condition.clone());
        nets = Some((net, judge_adam.step(judge, &loss.backward(), 1e-4)));
    };
    bencher.bench_local(|| in_bf16(bf16, &mut step));
}
