//! Objects in generated rooms: how they are lit, and what their shadows do, against the path-traced truth (`docs/evaluation.md`).

mod compare;
mod evaluation;
mod method;
mod objects;
mod places;
mod truth;

pub use evaluation::InsertionEvaluation;
pub use method::{InsertionMethod, Lamps};
