//! Training: complete runs, weights files, and overfitting of single scenes.
#![allow(clippy::unwrap_used)]

mod baseline;
mod encoder_weights;
#[path = "../../../../rooms/lo_dataset/tests/it/hypersim_layout.rs"]
mod hypersim_layout;
#[path = "../../../../rooms/lo_dataset/tests/it/layouts.rs"]
mod layouts;
mod overfit;
mod run;
mod size;
mod weight_files;

/// With the default allocator, page faults dominate a training step.
#[global_allocator]
static ALLOCATOR: mimalloc::MiMalloc = mimalloc::MiMalloc;
