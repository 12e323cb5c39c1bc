//! One module per command: its options, and what it does with the library.

pub mod bench;
pub mod completions;
pub mod dataset;
pub mod demo;
pub mod envmap;
pub mod estimate;
pub mod eval;
pub mod export;
pub mod insert;
pub mod inspect;
pub mod probes;
pub mod synth;
pub mod train;

mod environment;
mod parse;
mod shards;

use std::path::Path;

use anyhow::Context;
use lightoctree::scene::Scene;

/// Reads a scene file; errors name it.
fn read_scene(path: &Path) -> anyhow::Result<Scene> {
    Scene::read(path).with_context(|| format!("{}", path.display()))
}
