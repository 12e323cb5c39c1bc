//! Meshes of files, and rays that meet them. One binary, so that it is linked once.
#![allow(clippy::unwrap_used, missing_docs)]

mod intersection;
mod large;
mod real_files;
