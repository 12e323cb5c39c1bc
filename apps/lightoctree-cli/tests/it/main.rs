//! Runs the program as a user does. All tests are one binary, so that it is linked once.
#![allow(clippy::unwrap_used, missing_docs)]

mod support;

mod animation;
#[cfg(feature = "weights")]
mod batch;
mod cli;
#[cfg(feature = "depth-models")]
mod depth_models;
#[cfg(all(feature = "depth-models", feature = "weights"))]
mod footage;
mod given_input;
mod hostile;
mod kept_work;
mod photos;
mod placing;
mod unwrap;
mod view;
mod view_access;
mod view_in_browser;
mod view_rooms;
mod view_tools;
mod web_page;
