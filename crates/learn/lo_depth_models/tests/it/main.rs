//! Depth networks of others. One binary, so that it is linked once.
#![allow(clippy::unwrap_used)]

mod families;
mod hostile;
