//! The program, run as a user runs it.

pub mod browser;
pub mod run;
pub mod view;
pub mod weights;

pub use run::{done, json, refused};

/// What is run.
const PROGRAM: &str = "lightoctree";
