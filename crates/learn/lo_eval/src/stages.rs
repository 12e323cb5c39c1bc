//! Stages of an evaluation.

use lo_events::Stage;

/// Evaluating all methods on the photos of a dataset.
pub const EVALUATE_PHOTOS: Stage = Stage::new("evaluate photos");
