//! Benchmarks of the light network: the cases `graph_unet_*` of the peers' benchmark (with graphs rebuilt each time and
//! a few more input and output channels), and its training step with rays.
//!
//! `PEERS_INPUT` names a folder with the peers' point clouds (`rgbd_unit.npy`, `rgbd_color.npy`). By default, a
//! box-shaped room is used. `RAYON_NUM_THREADS` sets the number of threads. `MIMALLOC_PURGE_DELAY=10000` keeps memory
//! between steps, as the peers' `--tuned` does: 0 to 17 % of a training step.
//!
//! `MEMORY_OF_DEPTH=7 cargo bench -p lo_nets --bench light` measures memory instead of time. It prints the resident
//! memory before the first step of `graph_unet_train` and the peak after the fifth, in the format of the peers.

#[path = "../../../light/lo_octree/benches/cloud/mod.rs"]
mod cloud;

use burn::module::Module;
use burn::tensor::{Device, Tensor};
use divan::Bencher;
use lo_cone::{Cone, Settings};
use lo_geometry::{Camera, Cube, Vec3};
use lo_nets::Adam;
use lo_nets::graph::GraphLevel;
use lo_nets::light::{
    FreeSpace, Growth, LightInput, LightLossConfig, LightLosses, LightNet, LightNetConfig, LightOutput, NODE_FEATURES,
    Rays,
};
use lo_octree::{LightOctree, Provenance, RadiancePoint};

#[global_allocator]
static ALLOCATOR: mimalloc::MiMalloc = mimalloc::MiMalloc;

fn main() {
    // Runs on a pool thread: from other threads, each of some thousand small parallel loops waits for a pool thread to
    // wake.
    rayon::scope(|_| match std::env::var("MEMORY_OF_DEPTH") {
        Ok(depth) => print_memory(depth.parse().expect("MEMORY_OF_DEPTH is a depth")),
        Err(_) => divan::main(),
    });
}

/// Prints the resident memory of training in MiB, as reported by the kernel (Linux only).
fn print_memory(depth: u32) {
    let status = |field: &str| {
        let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
        let line = status.lines().find_map(|line| line.strip_prefix(field)).unwrap_or_default();
        let kib: f64 = line.trim_matches(|c: char| !c.is_ascii_digit()).parse().unwrap_or(f64::NAN);
        kib / 1024.0
    };
    let (input, config) = input(depth);
    let mut trainer = Trainer::new(&config);
    let base = status("VmRSS:");
    (0..5).for_each(|_| trainer.step(&input, plain_loss));
    let peak = status("VmHWM:");
    println!(
        r#"{{"peer": "lightoctree", "case": "graph_unet_d{depth}_train", "peak_rss_mib": {peak:.1}, "base_rss_mib": {base:.1}}}"#
    );
}

#[divan::bench(args = [6, 7], sample_count = 10)]
fn graph_unet_fwd(bencher: Bencher, depth: u32) {
    let (input, config) = input(depth);
    let net = LightNet::new(&config, 1, &Device::flex()).expect("a valid configuration");
    bencher.bench_local(|| net.forward(&input, None, Growth::Truth(&input.octree)).expect("the network's depths"));
}

#[divan::bench(args = [6, 7], sample_count = 10)]
fn graph_unet_train(bencher: Bencher, depth: u32) {
    let (input, config) = input(depth);
    let mut trainer = Trainer::new(&config);
    bencher.bench_local(|| trainer.step(&input, plain_loss));
}

/// A loss that depends on all outputs.
fn plain_loss(output: &LightOutput) -> Tensor<1> {
    let parts = output.levels.iter().map(|level| {
        let signal = level.light.clone() - 0.5;
        level.logits.clone().square().mean() + signal.square().mean()
    });
    parts.reduce(|a, b| a + b).expect("levels")
}

/// Trains on one scene with 8,192 rays.
#[divan::bench(args = [6, 7], sample_count = 10)]
fn train_step(bencher: Bencher, depth: u32) {
    let (input, config) = input(depth);
    let mut trainer = Trainer::new(&config);
    let rays: Rays = lo_geometry::fibonacci_sphere(8192)
        .into_iter()
        .map(|direction| {
            let tan_half_angle = (std::f32::consts::PI / 256.0).tan();
            (Cone { origin: Vec3::new(0.03, 0.02, 0.05), direction, tan_half_angle }, [0.5; 3], 1.0)
        })
        .collect();
    let none: Rays = std::iter::empty().collect();
    bencher.bench_local(|| {
        trainer.step(&input, |output| {
            let losses = LightLosses::new(output, &input.visible, &rays, &none, Settings::default());
            losses.expect("default settings").total(&LightLossConfig::default())
        });
    });
}

struct Trainer {
    /// `None` only while a step is running.
    net: Option<LightNet>,
    adam: Adam,
}

impl Trainer {
    fn new(config: &LightNetConfig) -> Self {
        let net = LightNet::new(config, 1, &Device::flex().autodiff()).expect("a valid configuration");
        Self { net: Some(net), adam: Adam::default() }
    }

    fn step(&mut self, input: &LightInput, loss: impl Fn(&LightOutput) -> Tensor<1>) {
        let net = self.net.take().expect("a network");
        let output = net.forward(input, None, Growth::Truth(&input.octree)).expect("the network's depths");
        let gradients = loss(&output).backward();
        self.net = Some(self.adam.step(net, &gradients, 1e-4));
    }
}

/// Uses the cloud's octree as input and as truth.
fn input(depth: u32) -> (LightInput, LightNetConfig) {
    let config = LightNetConfig { depth, channels_per_group: 1, ..LightNetConfig::default() };
    let points: Vec<RadiancePoint> = cloud::points("rgbd")
        .into_iter()
        .map(|point| RadiancePoint { radiance: [0.5; 3], provenance: Provenance::Inferred, ..point })
        .collect();
    let cube = Cube { origin_m: Vec3::splat(-1.0), edge_m: 2.0 };
    let (visible, _) = LightOctree::from_points(&points, cube, depth, config.full_depth).expect("valid depths");
    let levels = GraphLevel::all(&visible.octree);
    let nodes = levels[levels.len() - 1].len();
    let features = (0..nodes * NODE_FEATURES).map(|i| (0.7 * i as f32).sin()).collect();
    let net = LightNet::new(&config, 1, &Device::flex()).expect("a valid configuration");
    eprintln!("depth {depth}: {nodes} nodes, {} parameters", net.num_params());
    let camera = Camera::from_hfov_deg(60.0, 480, 320).expect("a plain camera");
    let free = FreeSpace::new(&[], &camera);
    (
        LightInput { levels, octree: visible.octree.clone(), features, visible, ambient: [0.3; 3], map: None, free },
        config,
    )
}
