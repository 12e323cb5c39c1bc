//! Benchmarks of DenseNet-121 at 480 × 320 (the cases `densenet121_480x320_*` of the peers' benchmark),
//! EfficientNet-Lite at 384 × 256, its depthwise convolutions, and the whole depth network. `depth_torch.py` beside
//! this file measures the same with PyTorch.
//!
//! `RAYON_NUM_THREADS` sets the number of threads. `MIMALLOC_PURGE_DELAY=100000` keeps memory between steps, as the
//! peers' `--tuned` does. `MIMALLOC_SHOW_STATS=1` prints peak memory. bf16 products need `--features amx`.

use burn::module::Module;
use burn::tensor::{Device, Distribution, Tensor};
use divan::Bencher;
use lo_imaging::{DepthMap, Image, RadianceImage};
use lo_nets::Adam;
use lo_nets::conv::{DepthwiseKernel, Window, in_bf16};
use lo_nets::cpu_ops::Kernel;
use lo_nets::depth::{DenseNet, DepthNet, Encoder, EncoderKind, PatchGan, depth_losses, panorama_loss};

#[global_allocator]
static ALLOCATOR: mimalloc::MiMalloc = mimalloc::MiMalloc;

fn main() {
    // Runs on a pool thread: from other threads, each of some thousand small parallel loops waits for a pool thread to
    // wake.
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

fn lite_and_photo(encoder: EncoderKind, images: usize) -> (Encoder, Tensor<4>) {
    let device = Device::flex().autodiff();
    let net = encoder.init(&mut lo_random::stream(1, "bench", 0), &device);
    (net, Tensor::random([3, images, 256, 384], Distribution::Default, &device))
}

const LITES: [EncoderKind; 2] = [EncoderKind::EfficientNetLite0, EncoderKind::EfficientNetLite2];

#[divan::bench(sample_count = 20, args = LITES)]
fn efficientnet_384x256_fwd(bencher: Bencher, encoder: EncoderKind) {
    let (net, photo) = lite_and_photo(encoder, 1);
    let (net, photo) = (net.valid(), photo.inner());
    bencher.bench_local(|| net.forward(photo.clone()));
}

/// Trains on eight photos.
#[divan::bench(sample_count = 5, args = LITES)]
fn efficientnet_384x256_train(bencher: Bencher, encoder: EncoderKind) {
    let (net, photos) = lite_and_photo(encoder, 8);
    let (mut net, mut adam) = (Some(net), Adam::default());
    bencher.bench_local(|| {
        let before = net.take().expect("a network");
        let [.., features] = before.forward(photos.clone());
        let gradients = features.square().mean().backward();
        net = Some(adam.step(before, &gradients, 1e-4));
    });
}

/// Depthwise convolutions of EfficientNet-Lite0 at 384 × 256: channels, kernel side, stride, height and width.
const DEPTHWISE: [[usize; 5]; 10] = [
    [32, 3, 1, 128, 192],
    [96, 3, 2, 128, 192],
    [144, 3, 1, 64, 96],
    [144, 5, 2, 64, 96],
    [240, 5, 1, 32, 48],
    [240, 3, 2, 32, 48],
    [480, 3, 1, 16, 24],
    [480, 5, 1, 16, 24],
    [672, 5, 2, 16, 24],
    [1152, 5, 1, 8, 12],
];

/// A depthwise convolution with PyTorch's padding, and a gradient of its output.
struct Depthwise {
    kernel: DepthwiseKernel,
    sizes: [[usize; 2]; 2],
    inputs: [Vec<f32>; 2],
    gradient: Vec<f32>,
}

impl Depthwise {
    fn new([channels, side, stride, height, width]: [usize; 5], images: usize) -> Self {
        let window = Window { images, ..Window::new([height, width], side, stride, [side / 2; 2]) };
        let kernel = DepthwiseKernel { window, rectifier: None };
        let sizes = [[channels, images * height * width], [channels, side * side]];
        let values = |count: usize| -> Vec<f32> { (0..count).map(|i| (0.7 * i as f32).sin()).collect() };
        let [_, area] = kernel.output_size(&sizes);
        let inputs = sizes.map(|[rows, columns]| values(rows * columns));
        Self { kernel, sizes, inputs, gradient: values(channels * area) }
    }

    fn backward(&self, wanted: [bool; 2]) -> Vec<Vec<f32>> {
        self.kernel.backward(&self.inputs.each_ref().map(Vec::as_slice), &self.sizes, &self.gradient, &wanted)
    }
}

#[divan::bench(sample_count = 20, args = DEPTHWISE, consts = [1, 8])]
fn depthwise_fwd<const IMAGES: usize>(bencher: Bencher, case: [usize; 5]) {
    let work = Depthwise::new(case, IMAGES);
    bencher.bench_local(|| work.kernel.forward(&work.inputs.each_ref().map(Vec::as_slice), &work.sizes));
}

#[divan::bench(sample_count = 20, args = DEPTHWISE, consts = [1, 8])]
fn depthwise_by_input<const IMAGES: usize>(bencher: Bencher, case: [usize; 5]) {
    let work = Depthwise::new(case, IMAGES);
    bencher.bench_local(|| work.backward([true, false]));
}

#[divan::bench(sample_count = 20, args = DEPTHWISE, consts = [1, 8])]
fn depthwise_by_weights<const IMAGES: usize>(bencher: Bencher, case: [usize; 5]) {
    let work = Depthwise::new(case, IMAGES);
    bencher.bench_local(|| work.backward([false, true]));
}

fn photo() -> Image<[u8; 3]> {
    Image::from_fn(480, 320, |x, y| [x as u8, y as u8, (x / 8 + y / 8) as u8])
}

/// Predicts depth and the global lighting feature.
#[divan::bench(sample_count = 10)]
fn depth_net_fwd(bencher: Bencher) {
    let (net, photo) = (DepthNet::new(EncoderKind::default(), 64, 1, &Device::flex()), photo());
    bencher.bench_local(|| net.forward(&[&photo]));
}

/// Runs a training step of network and discriminator with all losses, in f32 and with bf16 products.
#[divan::bench(sample_count = 5, args = [false, true])]
fn depth_net_train(bencher: Bencher, bf16: bool) {
    let (device, photo) = (Device::flex().autodiff(), photo());
    let mut nets = Some((DepthNet::new(EncoderKind::default(), 64, 1, &device), PatchGan::new(2, &device)));
    let (mut adam, mut discriminator_adam) = (Adam::default(), Adam::default());
    let truth = DepthMap::from_fn(480, 320, |x, y| 1.0 + 0.01 * (x + y) as f32);
    let sky = RadianceImage::from_fn(128, 64, |_, y| [if y < 20 { 8.0 } else { 0.2 }; 3]);
    let condition = Tensor::<4>::ones([4, 1, 64, 128], &device);
    let real = Tensor::<4>::ones([3, 1, 64, 128], &device);
    let mut step = || {
        let (net, discriminator) = nets.take().expect("networks");
        let output = net.forward(&[&photo]);
        let [log_depth, _, variance] = depth_losses(output.log_extent, &[&truth]);
        let generated = net.panorama.forward(output.global);
        let adversarial = discriminator.generator_loss(generated.clone(), condition.clone());
        let loss = log_depth + variance + panorama_loss(generated.clone(), &[Some(&sky)])[0].clone() + adversarial;
        let net = adam.step(net, &loss.backward(), 1e-4);
        let loss = discriminator.discriminator_loss(real.clone(), generated, condition.clone());
        nets = Some((net, discriminator_adam.step(discriminator, &loss.backward(), 1e-4)));
    };
    bencher.bench_local(|| in_bf16(bf16, &mut step));
}
