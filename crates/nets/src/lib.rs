//! The networks: dual-octree light network, differentiable rendering, depth and global light, losses.
//!
//! The only crate that knows burn, the deep-learning stack.

pub mod graph;
pub mod host;
pub mod layers;
pub mod light;
pub mod rendering;
#[cfg(test)]
mod testing;
