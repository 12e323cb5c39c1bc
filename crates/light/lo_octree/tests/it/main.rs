//! Octrees from points. A single binary, so that it is linked once.
#![allow(clippy::unwrap_used)]

mod construction;
mod opacity;
mod scaling;
mod tensors;
