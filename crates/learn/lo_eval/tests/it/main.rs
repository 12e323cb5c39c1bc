//! Measurements of cameras, several photos, published spheres and the sun. One binary, to link only once.
#![allow(clippy::unwrap_used, missing_docs)]

mod camera;
mod photos;
mod published;
mod sun;

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}
