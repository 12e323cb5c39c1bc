//! Insertion protocol: shading and shadows of objects in generated rooms, against path tracing (`docs/evaluation.md`).

mod compare;
mod evaluation;
mod footprints;
mod level_surfaces;
mod method;
mod objects;
mod photo;
mod truth;

pub use evaluation::InsertionEvaluation;
pub use level_surfaces::LevelSurfaces;
pub use method::{InsertionMethod, LampMode, ObjectLighting};
pub(crate) use photo::{PhotoObjects, PhotoReference, picture};
