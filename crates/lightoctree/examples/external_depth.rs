//! Estimates a scene file from a photo and a depth map, from a sensor or another network.
//!
//! `cargo run --release -p lightoctree --example external_depth [PHOTO DEPTH [SCENE]]`

use std::error::Error;
use std::path::Path;

use lightoctree::scene::Frame;
use lightoctree::{Document, EstimateOptions, Estimator, Input, events, imaging};

const PHOTO: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../apps/lightoctree-cli/assets/library_color.jpg");
const DEPTH: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../apps/lightoctree-cli/assets/library_lidar_depth.png");

fn main() -> Result<(), Box<dyn Error>> {
    let mut args = std::env::args().skip(1);
    let mut next = |default: &str| args.next().unwrap_or_else(|| default.to_owned());
    run(next(PHOTO).as_ref(), next(DEPTH).as_ref(), next("room.scene").as_ref())
}

/// Reads photo and depth, estimates the room and writes the scene.
pub fn run(photo: &Path, depth: &Path, scene: &Path) -> Result<(), Box<dyn Error>> {
    let photo = imaging::read_photo(photo)?;
    let estimator = Estimator::shipped()?;
    let (camera, _source) = estimator.camera_of(&photo)?;
    // Depth in metres along the optical axis, at any resolution. Integers are millimetres unless a scale is given.
    let depth_m = imaging::read_depth(depth, None)?;
    let frame = Frame::new(photo.photo, depth_m, camera, 1.0)?;
    // Depth from a network is `Input::PredictedDepth`: its floors are wavy, so up is estimated differently.
    let input = Input::MeasuredDepth(frame);
    let estimate = estimator.estimate(input, &EstimateOptions::default(), &mut events::ignore)?;
    Ok(Document::new(estimate).write(scene, "example external_depth")?)
}
