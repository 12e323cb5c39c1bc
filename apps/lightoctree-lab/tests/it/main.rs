//! The program as a user runs it. One binary, so that it is linked once.
#![allow(clippy::unwrap_used, missing_docs)]

mod support;

mod data;
mod documents;
mod eval;
mod train;
