//! Integration tests of mesh readers and ray casting. One binary, so that it is linked once.
#![allow(clippy::unwrap_used, missing_docs)]

mod intersection;
mod large;
mod real_files;
