//! One module per command: its options, and its calls of the library.

pub mod batch;
pub mod completions;
pub mod demo;
pub mod environment;
pub mod envmap;
pub mod estimate;
pub mod export;
pub mod insert;
pub mod inspect;
pub mod level;
pub mod light;
pub mod lights;
pub mod man;
pub mod parse;
pub mod probes;
pub mod unwrap;
mod video;
pub mod view;

#[cfg(feature = "depth-models")]
mod depth_model;
mod known_length;
mod lens;
mod panorama_prior;
mod photos;
mod samples;
mod state_folder;
mod token;

use std::path::Path;

use anyhow::Context;
use lightoctree::Estimator;
use lo_imaging as imaging;

/// Longest layout, path of keyframes and table of points, bytes.
const MAX_TEXT_BYTES: u64 = 64 << 20;

/// Reads a text file given by the user.
fn read_text(path: &Path) -> anyhow::Result<String> {
    imaging::read_regular_text(path, MAX_TEXT_BYTES).with_context(|| format!("cannot read {}", path.display()))
}

/// Creates an estimator with the networks of a weights file, or with those embedded in the program.
pub fn estimator(weights: Option<&Path>) -> anyhow::Result<Estimator> {
    match weights {
        Some(path) => Estimator::read(path).with_context(|| format!("--weights {}", path.display())),
        None => shipped_estimator(),
    }
}

#[cfg(feature = "weights")]
fn shipped_estimator() -> anyhow::Result<Estimator> {
    Ok(Estimator::shipped()?)
}

#[cfg(not(feature = "weights"))]
fn shipped_estimator() -> anyhow::Result<Estimator> {
    Err(crate::usage::Usage("this program was built without weights (feature `weights`); give --weights FILE".into())
        .into())
}
