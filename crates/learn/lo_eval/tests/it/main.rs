//! Cameras, photos and published figures. One binary, so that it is linked once.
#![allow(clippy::unwrap_used, missing_docs)]

mod camera;
mod photos;
mod published;
mod sun;

use std::path::Path;

use lo_estimate::Estimator;

/// The program's weights.
fn shipped() -> Estimator {
    let weights = "../lo_estimate/weights/lightoctree.safetensors";
    Estimator::read(Path::new(env!("CARGO_MANIFEST_DIR")).join(weights)).unwrap()
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}
