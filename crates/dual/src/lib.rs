//! The dual octree graph (Wang, Liu & Tong, *Dual Octree Graph Networks*, SIGGRAPH 2022), free of any deep-learning stack.

mod direction;
mod graph;

pub use direction::Direction;
pub use graph::{DualGraph, GraphNode};
