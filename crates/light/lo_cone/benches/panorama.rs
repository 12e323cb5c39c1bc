//! Rendering 256 × 128 panoramas of a room: the work of `panorama_*` in the peers' benchmark.
//!
//! `PEERS_INPUT` names a folder with the peers' cloud (`room_unit.npy`, `room_color.npy`). Without it, a bare box room
//! with as many points is used. `RAYON_NUM_THREADS` sets the thread count.

#[path = "../../../light/lo_octree/benches/cloud/mod.rs"]
mod cloud;

use divan::{Bencher, black_box};
use lo_cone::{Cone, ConeSample, ConeTracer, SampleGradient, SampleWeight, Sampling, Settings, StepRule};
use lo_geometry::{Cube, Vec3};
use lo_octree::{LightOctree, Provenance, RadiancePoint};

/// The peers' cube [−1, 1]³, full depth, opacity and viewpoint.
const CUBE: Cube = Cube { origin_m: Vec3::splat(-1.0), edge_m: 2.0 };
const FULL_DEPTH: u32 = 4;
const ALPHA: f32 = 0.95;
const PROBE: Vec3 = Vec3::new(0.03, 0.02, 0.05);

/// The peers' steps grow with the pitch of a pixel, twice its cone's half-angle.
const PEERS: Settings = Settings {
    step: StepRule::Floored(0.5),
    growth: 2.0,
    first_step: 1.0,
    weight: SampleWeight::One,
    sampling: Sampling::Nearest,
    min_transmittance: 1e-4,
};

const WIDTH: usize = 256;
const HEIGHT: usize = 128;

fn main() {
    divan::main();
}

/// Renders with the peers' steps.
#[divan::bench(args = [6, 7, 8])]
fn panorama_fwd(bencher: Bencher, depth: u32) {
    let tracer = tracer(depth, PEERS);
    bencher.bench(|| tracer.panorama(black_box(PROBE), WIDTH, HEIGHT));
}

/// Renders with the peers' steps, and computes the gradient of every RGBα for an output gradient of ones.
#[divan::bench(args = [6, 7, 8])]
fn panorama_fwdbwd(bencher: Bencher, depth: u32) {
    let tracer = tracer(depth, PEERS);
    let ones = SampleGradient { radiance: [1.0; 3], distance_m: 0.0, opacity: 0.0 };
    let cones: Vec<Cone> = (0..WIDTH * HEIGHT)
        .map(|pixel| Cone {
            origin: PROBE,
            direction: lo_geometry::pixel_direction(pixel % WIDTH, pixel / WIDTH, WIDTH, HEIGHT),
            tan_half_angle: (std::f32::consts::PI / WIDTH as f32).tan(),
        })
        .collect();
    let mut samples = vec![ConeSample::default(); cones.len()];
    bencher.bench_local(|| tracer.trace_with_gradients(black_box(&cones), &mut samples, &|_, _| ones));
}

/// Renders with the default settings: half of the peers' steps beyond the crossover.
#[divan::bench(args = [6, 7, 8])]
fn panorama_default(bencher: Bencher, depth: u32) {
    let tracer = tracer(depth, Settings::default());
    bencher.bench(|| tracer.panorama(black_box(PROBE), WIDTH, HEIGHT));
}

#[divan::bench(args = [6, 7, 8])]
fn panorama_interpolated(bencher: Bencher, depth: u32) {
    let tracer = tracer(depth, Settings { sampling: Sampling::Interpolated, ..Settings::default() });
    bencher.bench(|| tracer.panorama(black_box(PROBE), WIDTH, HEIGHT));
}

#[divan::bench(args = [6, 7, 8])]
fn prepare(bencher: Bencher, depth: u32) {
    let light = room(depth);
    bencher.bench(|| ConeTracer::new(black_box(&light), Settings::default()));
}

fn tracer(depth: u32, settings: Settings) -> ConeTracer {
    ConeTracer::new(&room(depth), settings).expect("valid settings")
}

fn room(depth: u32) -> LightOctree {
    let points = cloud::points("room");
    LightOctree::from_points_with_alpha(&points, CUBE, depth, FULL_DEPTH, ALPHA).expect("valid depths").0
}
