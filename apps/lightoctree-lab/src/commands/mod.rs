//! Commands: one module for each, with its options and implementation.

pub mod bench;
pub mod dataset;
pub mod eval;
pub mod study;
pub mod synth;
pub mod train;
pub mod train_baseline;
pub mod weights;
