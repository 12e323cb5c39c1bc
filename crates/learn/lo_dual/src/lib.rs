//! Dual octree graphs (Wang, Liu & Tong, *Dual Octree Graph Networks*, SIGGRAPH 2022) and their convolution, without a
//! deep-learning framework.

mod conv;
mod direction;
mod graph;
mod real;

pub use conv::{EDGE_TYPES, graph_conv, graph_conv_backward, graph_conv_onto};
pub use direction::Direction;
pub use graph::{DualGraph, GraphNode};
pub use real::{Matrix, Real, matmul};
