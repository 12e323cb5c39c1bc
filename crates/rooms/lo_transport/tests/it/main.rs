//! Light transport against closed forms and path tracing. A single binary, so that it is linked once.
#![allow(clippy::unwrap_used)]

mod support;

mod closed_form;
mod determinism;
mod points;
mod reference;
