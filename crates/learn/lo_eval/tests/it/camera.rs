//! Accuracy of predicted cameras on photos with known cameras: crops of real panoramas, and generated rooms.

use std::path::PathBuf;

use lo_dataset::{CropModel, Dataset, Panoramas, Shards};
use lo_estimate::Estimator;
use lo_sensor::Interval;

use crate::median;

#[test]
#[ignore = "needs panoramas: [PANORAMAS=…] [WEIGHTS=…] cargo test --release -p lo_eval --test it cameras_of_panoramas -- --ignored --nocapture"]
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
        report(&Panoramas::open(&folder, model).unwrap(), if even_sharpness { ", of equal sharpness" } else { "" });
    }
}

#[test]
#[ignore = "needs rooms: ROOMS=… [WEIGHTS=…] cargo test --release -p lo_eval --test it cameras_of_rooms -- --ignored --nocapture"]
fn cameras_of_rooms() {
    report(&Shards::open(&PathBuf::from(std::env::var_os("ROOMS").unwrap())).unwrap(), "");
}

/// Prints the errors of predicted up and field of view, beside a level camera and 65°. The networks are those of the
/// file `WEIGHTS`, or the shipped ones.
///
/// Also prints the share of errors within the predicted deviations.
fn report(photos: &dyn Dataset, what: &str) {
    let estimator = std::env::var_os("WEIGHTS").map_or_else(Estimator::shipped, Estimator::read).unwrap();
    let networks = estimator.networks().unwrap();
    let [mut up, mut level, mut fov, mut constant] = [const { Vec::new() }; 4];
    let mut within = [0.0f64; 2];
    for index in 0..photos.len() {
        let sample = photos.get(index).unwrap();
        let truth = sample.up.unwrap();
        let deg = |half_extent: f64| 2.0 * half_extent.atan().to_degrees();
        let true_fov = deg(sample.camera.half_extent());
        let found = networks.perspective(&sample.photo, None).expect("the weights predict the camera");
        up.push(f64::from(found.camera.up.angle_between(truth).to_degrees()));
        level.push(f64::from(lo_geometry::Vec3::Y.angle_between(truth).to_degrees()));
        fov.push((deg(found.camera.half_extent) - true_fov).abs());
        constant.push((65.0 - true_fov).abs());
        let predicted = [(up[index], found.up_deviation_deg), (fov[index], found.fov_deviation_deg)];
        predicted
            .iter()
            .zip(&mut within)
            .for_each(|((error, deviation), within)| *within += f64::from(u8::from(error <= deviation)));
        println!("{}: up {:.1}°, {:.1}° for {true_fov:.1}°", sample.id, up[index], deg(found.camera.half_extent));
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
    assert!(median(up) < 0.5 * median(level), "predicted up is hardly better than a level camera");
    assert!(median(fov) < median(constant), "the predicted field of view is no better than a constant");
    assert!(
        within.iter().all(|share| (0.45..0.95).contains(share)),
        "shares within the predicted deviations: {within:?}"
    );
}
