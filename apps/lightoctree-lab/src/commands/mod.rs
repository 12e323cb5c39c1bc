//! One module per command: its options, and what it does with the libraries.

pub mod bench;
pub mod dataset;
pub mod eval;
pub mod synth;
pub mod train;
pub mod weights;
