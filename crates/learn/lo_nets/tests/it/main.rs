//! The networks against the implementations of their authors.
#![allow(clippy::unwrap_used)]

mod densenet;
mod efficientnet;
mod formula;
mod ognn;
