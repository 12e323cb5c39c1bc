//! Objects in generated rooms: how they are lit, and what their shadows do, against the path-traced truth (`docs/evaluation.md`).

mod compare;
mod evaluation;
mod footprints;
mod method;
mod objects;
mod truth;

pub use evaluation::InsertionEvaluation;
pub use method::{InsertionMethod, LampMode};
