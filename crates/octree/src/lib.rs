//! Sparse voxel octree: shuffled keys, construction from points, neighbours, the RGBα pyramid and its tensors.

mod light;
mod topology;

pub use light::{Coverage, LightOctree, RadiancePoint};
pub use topology::{Level, Octree};
