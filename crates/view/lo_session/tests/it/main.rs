//! The viewer's session, and rooms from outside. One binary, so that it is linked once.
#![allow(clippy::unwrap_used, missing_docs)]

mod outside;
mod session;
