//! Sparse voxel octree: shuffled keys, construction from points, neighbours, RGBα pyramid and tensors.

mod change;
mod error;
mod find;
mod growth;
mod key;
mod leaves;
mod leaves_by_depth;
mod light;
mod limits;
mod lobes;
mod neighbours;
mod point;
mod pyramid;
mod sparse_leaves;
mod stats;
mod tensors;
mod topology;

pub use error::OctreeError;
pub use find::node_middle_m;
pub use key::{MAX_DEPTH, key_from_xyz, xyz_from_key};
pub use leaves::BuildReport;
pub use light::LightOctree;
pub use limits::{FORMAT_VERSION, MAX_ALPHA, MAX_CUBE_EDGE_M, MAX_FULL_DEPTH, MAX_RADIANCE, MIN_CUBE_EDGE_M};
pub use lobes::{MIN_SHARPNESS, lobe_gain};
pub use neighbours::Neighbours;
pub use point::{Provenance, RadiancePoint};
pub use pyramid::{Ancestor, LeafRows};
pub use stats::{LevelStats, OctreeStats};
pub use tensors::{NamedTensor, OctreeHeader, read_tensors, write_tensors};
pub use topology::{LeafNode, Level, Octree, check_depths};
