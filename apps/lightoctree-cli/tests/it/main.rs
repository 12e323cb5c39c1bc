//! The program as a user runs it. One binary, so that it is linked once.
#![allow(clippy::unwrap_used, missing_docs)]

mod support;

mod cli;
mod data;
#[cfg(feature = "depth-models")]
mod depth_models;
mod documents;
mod eval;
mod photos;
mod train;
mod unwrap;
mod view;
mod view_in_browser;
