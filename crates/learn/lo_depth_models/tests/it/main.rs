//! Third-party depth networks. One binary for all tests, so that it is linked once.
#![allow(clippy::unwrap_used)]

mod families;
mod hostile;
