//! What networks tell of the camera of photos whose cameras are known exactly: photos that are cut out of real panoramas, and generated ones.

use std::path::PathBuf;

use lightoctree::nets::Networks;
use lo_dataset::{CropModel, Dataset, Panoramas, Shards};
use lo_sensor::Interval;

use crate::median;

#[test]
#[ignore = "needs weights: WEIGHTS=… [PANORAMAS=…] cargo test --release -p lo_eval --test it cameras_of_panoramas -- --ignored --nocapture"]
fn cameras_of_panoramas() {
    let folder = std::env::var_os("PANORAMAS").map_or_else(lo_testdata::panoramas, PathBuf::from);
    for even_sharpness in [false, true] {
        let model = CropModel {
            crops: 4,
            hfov_deg: Interval::new(45.0, 90.0),
            pitch_deg: Interval::new(-30.0, 30.0),
            roll_deg: Interval::new(-8.0, 8.0),
            even_sharpness,
            seed: 1,
            ..CropModel::default()
        };
        report(&Panoramas::open(&folder, model).unwrap(), if even_sharpness { ", alike in sharpness" } else { "" });
    }
}

#[test]
#[ignore = "needs weights and rooms: WEIGHTS=… ROOMS=… cargo test --release -p lo_eval --test it cameras_of_rooms -- --ignored --nocapture"]
fn cameras_of_rooms() {
    report(&Shards::open(&PathBuf::from(std::env::var_os("ROOMS").unwrap())).unwrap(), "");
}

/// How far off up and the lens are that the networks of `WEIGHTS` tell of all photos, beside a level camera and 65°.
fn report(photos: &dyn Dataset, what: &str) {
    let networks = Networks::read(std::env::var_os("WEIGHTS").unwrap()).unwrap();
    let [mut up, mut level, mut fov, mut constant] = [const { Vec::new() }; 4];
    for index in 0..photos.len() {
        let sample = photos.get(index).unwrap();
        let truth = sample.up.unwrap();
        let deg = |half_extent: f64| 2.0 * half_extent.atan().to_degrees();
        let own = deg(sample.camera.half_extent());
        let found = networks.perspective(&sample.photo, None).expect("weights that have learned the camera").camera;
        up.push(f64::from(found.up.angle_between(truth).to_degrees()));
        level.push(f64::from(lo_geometry::Vec3::Y.angle_between(truth).to_degrees()));
        fov.push((deg(found.half_extent) - own).abs());
        constant.push((65.0 - own).abs());
        println!("{}: up {:.1}°, {:.1}° for {own:.1}°", sample.id, up[index], deg(found.half_extent));
    }
    let mean = up.iter().sum::<f64>() / up.len() as f64;
    println!(
        "{} photos{what}: up {:.2}° median, {mean:.2}° mean, level {:.2}°; field of view {:.2}° median, 65° {:.2}°",
        up.len(),
        median(up),
        median(level),
        median(fov),
        median(constant)
    );
}
