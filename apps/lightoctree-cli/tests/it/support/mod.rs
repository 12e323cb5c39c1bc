//! Runs the program as a user does.

pub mod browser;
pub mod programs;
pub mod run;
pub mod tls_proxy;
pub mod view;
pub mod weights;

pub use run::{done, json, refused};

/// Name of the program under test.
const PROGRAM: &str = "lightoctree";
