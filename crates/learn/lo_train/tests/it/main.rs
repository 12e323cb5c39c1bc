//! The networks learn, in runs as a whole and on scenes of their own.
#![allow(clippy::unwrap_used)]

mod encoder_weights;
mod overfit;
mod run;
mod size;
mod weight_files;

/// Without it most of a step is spent on page faults.
#[global_allocator]
static ALLOCATOR: mimalloc::MiMalloc = mimalloc::MiMalloc;
