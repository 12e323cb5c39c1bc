//! The program as a user runs it. One binary, so that it is linked once.
#![allow(clippy::unwrap_used, missing_docs)]

mod support;

mod cli;
#[cfg(feature = "depth-models")]
mod depth_models;
mod photos;
mod unwrap;
mod view;
mod view_in_browser;
