//! Tests of the command line. One binary, to link only once.
#![allow(clippy::unwrap_used, missing_docs)]

mod support;

mod baseline;
mod data;
mod documents;
mod eval;
mod study;
mod train;
