//! Stages of training, beside those of its phases ([`TrainConfig::phase_stages`](crate::TrainConfig::phase_stages)).

use lo_events::Stage;

/// Evaluating on scenes held out of training. Its figures are those of a
/// [`ValidationReport`](crate::ValidationReport).
pub const VALIDATION: Stage = Stage::new("validation");

/// Writing a checkpoint.
pub const CHECKPOINT: Stage = Stage::new("checkpoint");
