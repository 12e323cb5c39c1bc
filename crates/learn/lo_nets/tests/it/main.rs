//! Tests networks against their authors' implementations.
#![allow(clippy::unwrap_used)]

mod densenet;
mod efficientnet;
mod formula;
mod ognn;
