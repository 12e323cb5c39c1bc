//! The networks: dual-octree light network, differentiable rendering, depth and global light, losses.
//!
//! Beside the trainer the only crate that knows burn, the deep-learning stack.

mod adam;
pub mod checkpoint;
pub mod conv;
pub mod depth;
mod energy;
pub mod expected;
mod flat;
pub mod graph;
pub mod host;
pub mod layers;
pub mod light;
mod names;
mod networks;
pub mod rendering;
mod second_look;
mod sums;
#[cfg(test)]
mod testing;
mod tone;

pub use adam::Adam;
pub use burn::tensor::Device;
pub use networks::{CompletedLight, DEPTH_NET, EXPECTED_NET, GlobalLight, LIGHT_NET, Networks, PhotoGuess, SeenRoom};
