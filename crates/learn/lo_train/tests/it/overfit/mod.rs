//! Overfits the light network to scenes and measures novel views.
//!
//! Long tests run by `cargo test --release -p lo_train --test it -- --ignored --nocapture NAME`:
//!
//! | NAME | scene | minutes |
//! | --- | --- | --- |
//! | `a_box_room_is_overfitted` | a room of known radiance, d = 6 | 15 |
//! | `a_generated_room_is_overfitted` | a furnished room, compared with the upper bound of its octree | 20 |
//! | `eight_box_rooms_are_overfitted` | rooms of different sizes and colours | 20 |
//! | `eight_generated_rooms_are_overfitted` | furnished rooms | 60 |
//!
//! `LIGHTOCTREE_MINUTES` overrides the duration.

mod ceiling;
mod room;
mod scene;
mod training;

use burn::module::Module;
use lo_dataset::{Generator, GeneratorConfig, Sample};
use lo_nets::light::{LightNet, LightNetConfig};
use lo_octree::LightOctree;

use self::room::BoxRoom;
use self::scene::{Figures, Scene};
use self::training::{Training, Until};

fn default_config(depth: u32) -> LightNetConfig {
    LightNetConfig { depth, ..LightNetConfig::default() }
}

fn print(what: &str, figures: Figures) {
    println!("{what}: {:.2} dB, log-RMSE {:.4}", figures.psnr_db, figures.log_rmse);
}

/// Trains on one scene. Returns its figures before and after, and the share of correct labels.
fn overfit(scene: &Scene, config: &LightNetConfig, training: &Training) -> (Figures, Figures, f64) {
    let mut before = None;
    let figures = |net: &LightNet| scene.figures(&scene.completed(&net.valid()));
    print("the true octree", scene.figures(&scene.truth));
    let net = training.run(
        config,
        |_| scene,
        |net, done| {
            before.get_or_insert_with(|| figures(net));
            print(&format!("{:.0} %", 100.0 * done), figures(net));
        },
    );
    let (after, right) = (figures(&net), scene.labels_right(&net.valid()));
    println!("{:.2} % of the labels right", 100.0 * right);
    (before.unwrap(), after, right)
}

#[test]
fn a_box_room_is_learned() {
    let small = LightNetConfig { channels: 16, max_channels: 32, blocks: 1, ..default_config(5) };
    let plain = LightNetConfig { full_depth: 3, bottleneck: 2, head_channels: 16, ..small };
    for config in [LightNetConfig { lobes: true, ..plain.clone() }, plain] {
        let scene = Scene::new(BoxRoom::USUAL.sample(8), 4, &config);
        let training = Training { until: Until::Steps(80), rate: 6e-3, halved_after: 200.0, rays: 2048 };
        let (before, after, right) = overfit(&scene, &config, &training);
        assert!(after.psnr_db > before.psnr_db + 6.0 && after.psnr_db > 20.0, "{} dB", after.psnr_db);
        assert!(right > 0.95, "{right}");
    }
}

#[test]
#[ignore = "15 minutes; see the head of the file"]
fn a_box_room_is_overfitted() {
    let config = default_config(6);
    let scene = Scene::new(BoxRoom::USUAL.sample(84), 21, &config);
    let training = Training { until: Until::Minutes(minutes(15.0)), rate: 4e-3, halved_after: 200.0, rays: 8192 };
    let (_, after, right) = overfit(&scene, &config, &training);
    assert!(after.psnr_db >= 28.0, "{} dB", after.psnr_db);
    assert!(right >= 0.98, "{right}");
}

#[test]
#[ignore = "20 minutes; see the head of the file"]
fn a_generated_room_is_overfitted() {
    let config = default_config(6);
    let scene = Scene::new(generated(0, 210), 21, &config);
    let possible = scene.figures(&ceiling::fitted_octree(&scene, 400));
    print("the octree fitted without a network", possible);
    let training = Training { until: Until::Minutes(minutes(15.0)), rate: 4e-3, halved_after: 200.0, rays: 8192 };
    let (_, after, right) = overfit(&scene, &config, &training);
    // Leaves of a decimetre cannot resolve furniture: neither the true octree nor the fitted one reaches 28 dB.
    // Measured: 23.1 dB, the true octree 21.7, the fitted one 25.1.
    assert!(after.psnr_db > scene.figures(&scene.truth).psnr_db + 0.5, "{} dB", after.psnr_db);
    assert!(after.psnr_db > possible.psnr_db - 3.0, "{} dB of {}", after.psnr_db, possible.psnr_db);
    assert!(right >= 0.98, "{right}");
}

#[test]
#[ignore = "20 minutes; see the head of the file"]
fn eight_box_rooms_are_overfitted() {
    let config = default_config(6);
    let scenes: [Scene; 8] =
        std::array::from_fn(|index| Scene::new(BoxRoom::drawn(index as u64).sample(84), 21, &config));
    let net = overfit_all(&scenes, &config, minutes(20.0));
    assert!(scenes.iter().all(|scene| scene.labels_right(&net) >= 0.98));
    let after = mean_db(&scenes, |scene| scene.completed(&net));
    assert!(after >= 24.0, "{after} dB");
}

#[test]
#[ignore = "an hour; see the head of the file"]
fn eight_generated_rooms_are_overfitted() {
    let config = default_config(6);
    let scenes: [Scene; 8] = std::array::from_fn(|index| Scene::new(generated(index as u64, 84), 14, &config));
    let fitted = mean_db(&scenes, |scene| ceiling::fitted_octree(scene, 400));
    println!("octrees fitted without a network: {fitted:.2} dB");
    let net = overfit_all(&scenes, &config, minutes(60.0));
    let (truth, after) = (mean_db(&scenes, |scene| scene.truth.clone()), mean_db(&scenes, |s| s.completed(&net)));
    assert!(scenes.iter().all(|scene| scene.labels_right(&net) >= 0.98));
    // Leaves of a decimetre cannot resolve furniture: the best octree has 24 dB.
    assert!(after > truth + 0.5, "{after} dB, the true octrees {truth}");
}

/// Trains on several scenes, one per step in turn.
fn overfit_all(scenes: &[Scene; 8], config: &LightNetConfig, minutes: f64) -> LightNet {
    println!("the true octrees: {:.2} dB", mean_db(scenes, |scene| scene.truth.clone()));
    let training = Training { until: Until::Minutes(minutes), rate: 4e-3, halved_after: 1600.0, rays: 8192 };
    let report = |net: &LightNet, done: f64| {
        let net = net.valid();
        println!("{:.0} %: {:.2} dB", 100.0 * done, mean_db(scenes, |scene| scene.completed(&net)));
    };
    let net = training.run(config, |step| &scenes[step as usize % 8], report).valid();
    for (index, scene) in scenes.iter().enumerate() {
        print(&format!("room {index}: the true octree"), scene.figures(&scene.truth));
        print("  the network", scene.figures(&scene.completed(&net)));
        println!("  {:.2} % of the labels right", 100.0 * scene.labels_right(&net));
    }
    net
}

fn mean_db(scenes: &[Scene; 8], of: impl Fn(&Scene) -> LightOctree) -> f64 {
    scenes.iter().map(|scene| scene.figures(&of(scene)).psnr_db / 8.0).sum()
}

/// Returns `LIGHTOCTREE_MINUTES`, or else `default`.
fn minutes(default: f64) -> f64 {
    std::env::var("LIGHTOCTREE_MINUTES")
        .map_or(default, |minutes| minutes.parse().expect("LIGHTOCTREE_MINUTES is a number"))
}

/// Generates a room and returns its sample, with many panoramas.
fn generated(index: u64, panoramas: u32) -> Sample {
    let settings = GeneratorConfig { shots: 1, panoramas, octree_depth: 7, ..GeneratorConfig::default() };
    Generator::new(7, settings).unwrap().record(index).unwrap().sample(0)
}
