//! The light network learns: one scene is overfitted and seen from places that it was not trained on.
//!
//! `cargo test --release -p lightoctree-nets --test overfit -- --ignored --nocapture` runs the long ones.
#![allow(clippy::unwrap_used)]

mod room;

use std::time::Instant;

use burn::module::Module;
use burn::tensor::Device;
use cone::{ConeTracer, Settings};
use dataset::{Generator, GeneratorConfig, NovelView, Sample};
use geometry::{Cube, Vec3};
use imaging::Image;
use lightoctree_nets::Adam;
use lightoctree_nets::light::{
    Growth, LightInput, LightLossConfig, LightLosses, LightNet, LightNetConfig, Rays, VisiblePoint,
};
use octree::LightOctree;

/// Without it most of a step is spent on page faults.
#[global_allocator]
static ALLOCATOR: mimalloc::MiMalloc = mimalloc::MiMalloc;

/// What is seen of a room, its truth, panoramas to learn from and others to be judged by.
struct Scene {
    input: LightInput,
    truth: LightOctree,
    photo: Image<[f32; 3]>,
    sample: Sample,
    held_out: Vec<NovelView>,
}

impl Scene {
    /// Takes `held_out` panoramas away from the sample.
    fn new(mut sample: Sample, held_out: usize, config: &LightNetConfig) -> Self {
        let photo = Image::from_fn(sample.photo.width(), sample.photo.height(), |x, y| {
            sample.photo[(x, y)].map(imaging::linear_from_srgb8)
        });
        let depth_m = sample.depth_m.as_ref().unwrap();
        let visible = VisiblePoint::from_photo(&photo, depth_m, sample.normal.as_ref(), &sample.camera, 0.99);
        let cube = cube_around(&sample);
        let held_out = sample.views.split_off(sample.views.len() - held_out);
        Self {
            input: LightInput::new(&visible, &sample.camera, cube, config, 7).unwrap(),
            truth: LightOctree::from_points(&sample.points, cube, config.depth, config.full_depth).unwrap().0,
            photo,
            sample,
            held_out,
        }
    }

    /// Mean PSNR of the held-out panoramas, encoded as sRGB and clipped to [0, 1].
    fn psnr_db(&self, light: &LightOctree) -> f64 {
        let tracer = ConeTracer::new(light, Settings::default()).unwrap();
        let mut squares = 0.0;
        for view in &self.held_out {
            let rays = Rays::of_panorama(view);
            let mut samples = vec![cone::Sample::default(); rays.len()];
            tracer.trace_batch(&rays.cones, &mut samples);
            let encoded = |c: f32| f64::from(imaging::srgb_from_linear(c.clamp(0.0, 1.0)));
            let pairs = samples.iter().zip(&rays.radiance).flat_map(|(s, t)| s.radiance.into_iter().zip(*t));
            squares += pairs.map(|(a, b)| (encoded(a) - encoded(b)).powi(2)).sum::<f64>() / (3 * rays.len()) as f64;
        }
        -10.0 * (squares / self.held_out.len() as f64).log10()
    }
}

fn cube_around(sample: &Sample) -> Cube {
    let positions = || sample.points.iter().map(|p| p.position_m);
    let low = positions().reduce(Vec3::min).unwrap();
    let high = positions().reduce(Vec3::max).unwrap();
    Cube::centred(0.5 * (low + high), 1.02 * (high - low).max_element())
}

/// What came of training.
struct Report {
    before_db: f64,
    after_db: f64,
    /// Share of the split labels that are right on the true tree.
    labels_right: f64,
}

fn overfit(
    scene: &Scene,
    config: &LightNetConfig,
    rate: f64,
    rays: usize,
    done: impl Fn(usize, Instant) -> bool,
) -> Report {
    let device = Device::flex().autodiff();
    let mut net = LightNet::new(config, 5, &device).unwrap();
    let weights = LightLossConfig::default();
    let mut adam = Adam::default();
    let grown = |net: &LightNet, growth| net.valid().forward(&scene.input, None, growth).unwrap();
    let before_db = scene.psnr_db(&grown(&net, Growth::Truth(&scene.truth.octree)).into_light().unwrap().0);
    let start = Instant::now();
    let mut step = 0;
    while !done(step, start) {
        let mut stream = random::stream(11, "rays", step as u64);
        let novel = Rays::of_panoramas(&scene.sample.views, rays * 3 / 4, &mut stream);
        let depth_m = scene.sample.depth_m.as_ref().unwrap();
        let visible = Rays::of_photo(&scene.photo, depth_m, &scene.sample.camera, 0.99, rays / 4, &mut stream);
        let output = net.forward(&scene.input, None, Growth::Truth(&scene.truth.octree)).unwrap();
        let losses = LightLosses::new(&output, &scene.truth, &novel, &visible, Settings::default()).unwrap();
        let total = losses.total(&weights);
        if step % 20 == 0 {
            let of = |t: &burn::tensor::Tensor<1>| t.clone().inner().into_scalar::<f32>();
            println!(
                "step {step:4} {:5.0} s: octree {:.4} novel {:.5} {:.5} visible {:.5} nodes {:.5} error {:.4}",
                start.elapsed().as_secs_f64(),
                of(&losses.octree),
                of(&losses.novel.radiance),
                of(&losses.novel.distance),
                of(&losses.visible.radiance),
                of(&losses.node_radiance),
                of(&losses.node_error),
            );
        }
        let gradients = total.backward();
        // Towards the end in smaller and smaller steps.
        net = adam.step(net, &gradients, rate / (1.0 + step as f64 / 200.0));
        step += 1;
    }
    let own = grown(&net, Growth::Truth(&scene.truth.octree));
    let (mut right, mut all) = (0, 0);
    for (depth, level) in (config.full_depth..config.depth).zip(&own.levels) {
        let logits: Vec<f32> = level.logits.clone().into_data().iter().collect();
        let truth = &scene.truth.octree.levels()[depth as usize];
        right += logits.iter().zip(&truth.rows).filter(|(l, row)| (**l > 0.0) == (**row >= 0)).count();
        all += logits.len();
    }
    let after_db = scene.psnr_db(&grown(&net, Growth::Predicted).into_light().unwrap().0);
    println!("{step} steps in {:.0} s", start.elapsed().as_secs_f64());
    Report { before_db, after_db, labels_right: right as f64 / all as f64 }
}

fn report(scene: &Scene, report: &Report) {
    println!(
        "unseen panoramas {:.2} dB before, {:.2} dB after (the true octree: {:.2} dB); {:.2} % of the labels right",
        report.before_db,
        report.after_db,
        scene.psnr_db(&scene.truth),
        100.0 * report.labels_right
    );
}

#[test]
fn a_box_room_is_learned() {
    let small = LightNetConfig { depth: 5, channels: 16, max_channels: 32, blocks: 1, ..LightNetConfig::default() };
    let config = LightNetConfig { full_depth: 3, bottleneck: 2, head_channels: 16, ..small };
    let scene = Scene::new(room::sample(), 2, &config);
    let result = overfit(&scene, &config, 6e-3, 2048, |step, _| step == 80);
    report(&scene, &result);
    assert!(result.after_db > result.before_db + 6.0 && result.after_db > 20.0, "{} dB", result.after_db);
    assert!(result.labels_right > 0.95, "{}", result.labels_right);
}

#[test]
#[ignore = "15 minutes; see the head of the file"]
fn a_generated_room_is_learned() {
    const MINUTES: f64 = 15.0;
    let depth = 6;
    let config = LightNetConfig { depth, ..LightNetConfig::default() };
    let settings = GeneratorConfig { shots: 1, panoramas: 10, octree_depth: depth, ..GeneratorConfig::default() };
    let sample = Generator::new(7, settings).unwrap().record(0).unwrap().sample(0);
    let scene = Scene::new(sample, 2, &config);
    println!("{} nodes at the finest depth", scene.truth.octree.levels()[depth as usize].len());
    let result = overfit(&scene, &config, 4e-3, 8192, |_, start| start.elapsed().as_secs_f64() > 60.0 * MINUTES);
    report(&scene, &result);
    // The true octree of this depth itself stays below 24 dB: leaves of a decimetre cannot show what panoramas do.
    assert!(result.after_db > 20.0, "{} dB", result.after_db);
    assert!(result.labels_right > 0.98, "{}", result.labels_right);
}
