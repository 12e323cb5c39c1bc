//! The examples, on the photo that the program carries.
#![cfg(feature = "weights")]
#![allow(clippy::unwrap_used, dead_code)]

use std::path::Path;

use lightoctree::{Document, imaging};

#[path = "../examples/envmap.rs"]
mod envmap;
#[path = "../examples/estimate.rs"]
mod estimate;
#[path = "../examples/external_depth.rs"]
mod external_depth;
#[path = "../examples/insert.rs"]
mod insert;
#[path = "../examples/probes.rs"]
mod probes;

#[test]
fn examples_do_what_they_say() {
    let assets = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../apps/lightoctree-cli/assets");
    let photo = assets.join("library_color.jpg");
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);

    estimate::run(&photo, &at("alone.scene")).unwrap();
    assert!(Document::read(&at("alone.scene")).unwrap().estimate.origin.predicted_depth);

    external_depth::run(&photo, &assets.join("library_lidar_depth.png"), &at("room.scene")).unwrap();
    let scene = Document::read(&at("room.scene")).unwrap().estimate;
    assert!(!scene.origin.predicted_depth && scene.confidence.is_some(), "by the network");

    envmap::run(&at("room.scene"), &at("panorama.exr")).unwrap();
    let panorama = imaging::read_radiance(at("panorama.exr")).unwrap();
    assert!(panorama.pixels().iter().all(|rgb| rgb.iter().all(|c| c.is_finite())));
    assert!(panorama[(256, 128)].iter().all(|&c| c > 0.0), "straight ahead is the shelf");

    let suzanne = Path::new(env!("CARGO_MANIFEST_DIR")).join("models/suzanne.glb");
    insert::run(&at("room.scene"), &suzanne, &at("inserted.png")).unwrap();
    let (before, after) = (scene.frame.photo.radiance(), imaging::read_photo(at("inserted.png")).unwrap());
    let changed = before.pixels().iter().zip(after.photo.radiance().pixels()).filter(|(a, b)| a != b).count();
    assert!((10_000..2_000_000).contains(&changed), "{changed} pixels show the object or its shadow");

    probes::run(&at("room.scene"), &at("probes")).unwrap();
    for index in 0..4 {
        let probe = imaging::read_radiance(at("probes").join(format!("probe_{index}.exr"))).unwrap();
        assert_eq!((probe.width(), probe.height()), (128, 64));
    }
}
