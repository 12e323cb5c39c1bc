//! Sparse voxel octree: shuffled keys, construction from points, neighbours, the RGBα pyramid and its tensors.

mod corners;
mod error;
mod find;
mod growth;
mod key;
mod leaves;
mod light;
mod lobes;
mod neighbours;
mod pyramid;
mod stats;
mod tensors;
mod topology;

pub use error::OctreeError;
pub use find::node_middle_m;
pub use key::{MAX_DEPTH, key_from_xyz, xyz_from_key};
pub use leaves::BuildReport;
pub use light::{Coverage, LightOctree, MAX_ALPHA, RadiancePoint};
pub use lobes::{LEAST_SHARPNESS, lobe_gain};
pub use neighbours::Neighbours;
pub use stats::{LevelStats, OctreeStats};
pub use tensors::{FORMAT_VERSION, NamedTensor, OctreeHeader, read_tensors, write_tensors};
pub use topology::{Level, MAX_FULL_DEPTH, Octree, check_depths};
