//! Measurements of cameras, several photos, published spheres and the sun. One binary, to link only once.
#![allow(clippy::unwrap_used, missing_docs)]

mod baselines;
mod camera;
mod data_sets;
#[path = "../../../../rooms/lo_dataset/tests/it/hypersim_layout.rs"]
mod hypersim_layout;
#[path = "../../../../rooms/lo_dataset/tests/it/layouts.rs"]
#[expect(dead_code, reason = "not all layouts are evaluated")]
mod layouts;
#[path = "../../../../rooms/lo_dataset/tests/it/lighthouse_layout.rs"]
mod lighthouse_layout;
mod photos;
mod published;
mod sun;

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}
