//! Insertion protocol: shading and shadows of objects in generated rooms, against path tracing (`docs/evaluation.md`).

mod compare;
mod evaluation;
mod footprints;
mod method;
mod objects;
mod truth;

pub use evaluation::InsertionEvaluation;
pub use method::{InsertionMethod, LampMode};
