//! The viewer's session, its choice of light, and rooms from outside. One binary, so that it is linked once.
#![allow(clippy::unwrap_used, missing_docs)]

mod guessed;
mod outside;
mod session;
