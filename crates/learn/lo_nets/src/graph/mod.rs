//! Operations on dual octree graphs. Each is a CPU kernel ([`crate::cpu_ops`]), tested against a composition of burn's
//! operations.

mod conv;
mod level;
mod linear;
mod norm;
mod pool;
mod rows;

pub(crate) use conv::type_channels_of;
pub use conv::{graph_conv, type_channels};
pub use level::{GraphLevel, NodeTypes, Refinement};
pub use linear::linear;
pub use norm::{Activation, normalise, normalise_and_add};
pub use pool::{down_sample, up_sample};
pub use rows::{RowMap, select_rows};

#[cfg(test)]
pub(crate) use level::tests::uneven_octree;
