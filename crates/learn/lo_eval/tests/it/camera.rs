//! What networks tell of the camera of photos whose cameras are known exactly: photos that are cut out of real panoramas, and generated ones.

use std::path::PathBuf;

use lo_dataset::{CropModel, Dataset, Panoramas, Shards};
use lo_nets::Networks;
use lo_sensor::Interval;

use crate::median;

#[test]
#[ignore = "needs weights: WEIGHTS=… [PANORAMAS=…] cargo test --release -p lo_eval --test it cameras_of_panoramas -- --ignored --nocapture"]
fn cameras_of_panoramas() {
    let folder = std::env::var_os("PANORAMAS").map_or_else(lo_testdata::panoramas, PathBuf::from);
    for even_sharpness in [false, true] {
        let model = CropModel {
            crops: 4,
            hfov_deg: Interval::new(45.0, 110.0),
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

/// How far off up and the lens are that the networks of `WEIGHTS` tell of all photos, beside a level camera and 65°, and how many lie within what is said.
fn report(photos: &dyn Dataset, what: &str) {
    let networks = Networks::read(std::env::var_os("WEIGHTS").unwrap()).unwrap();
    let [mut up, mut level, mut fov, mut constant] = [const { Vec::new() }; 4];
    let mut within = [0.0f64; 2];
    for index in 0..photos.len() {
        let sample = photos.get(index).unwrap();
        let truth = sample.up.unwrap();
        let deg = |half_extent: f64| 2.0 * half_extent.atan().to_degrees();
        let own = deg(sample.camera.half_extent());
        let found = networks.perspective(&sample.photo, None).expect("weights that have learned the camera");
        up.push(f64::from(found.camera.up.angle_between(truth).to_degrees()));
        level.push(f64::from(lo_geometry::Vec3::Y.angle_between(truth).to_degrees()));
        fov.push((deg(found.camera.half_extent) - own).abs());
        constant.push((65.0 - own).abs());
        let said = [(up[index], found.up_deviation_deg), (fov[index], found.fov_deviation_deg)];
        said.iter().zip(&mut within).for_each(|((off, said), within)| *within += f64::from(u8::from(off <= said)));
        println!("{}: up {:.1}°, {:.1}° for {own:.1}°", sample.id, up[index], deg(found.camera.half_extent));
    }
    let number = up.len() as f64;
    let mean = up.iter().sum::<f64>() / number;
    let within = within.map(|count| count / number);
    println!(
        "{} photos{what}: up {:.2}° median, {mean:.2}° mean, level {:.2}°, {:.0} % within ±; field of view {:.2}° median, 65° {:.2}°, {:.0} % within ±",
        up.len(),
        median(up.clone()),
        median(level.clone()),
        100.0 * within[0],
        median(fov.clone()),
        median(constant.clone()),
        100.0 * within[1],
    );
    assert!(median(up) < 0.5 * median(level), "up is hardly better than that cameras are level");
    assert!(median(fov) < median(constant), "the lens is no better than a constant");
    assert!(within.iter().all(|share| (0.45..0.95).contains(share)), "{within:?} lie within what is said");
}
