//! Stages of an evaluation.

use lo_events::Stage;

/// Evaluating all methods on the photos of a dataset.
pub const EVALUATE_PHOTOS: Stage = Stage::new("evaluate photos");

/// Writing the photos of a dataset for other programs.
pub const WRITE_PHOTOS: Stage = Stage::new("write photos");
