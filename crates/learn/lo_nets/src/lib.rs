//! Neural networks: dual-octree light network, differentiable rendering, depth and global light, and their losses.
//!
//! Only this crate, the baselines and the trainer depend on burn, the deep-learning stack.

#[cfg(feature = "training")]
mod adam;
pub mod checkpoint;
pub mod conv;
pub mod cpu_ops;
pub mod depth;
mod energy;
pub mod expected;
mod gemm;
pub mod graph;
pub mod layers;
pub mod light;
mod networks;
mod parameter_path;
mod plane_snapping;
pub mod rendering;
mod test_time_augmentation;
#[cfg(test)]
mod testing;
mod tone;

#[cfg(feature = "training")]
pub use adam::Adam;
pub use burn::tensor::Device;
pub use networks::{
    CompletedLight, DEPTH_NET, EXPECTED_NET, GlobalLight, LIGHT_NET, Networks, ObservedRoom, PhotoPrediction,
};
