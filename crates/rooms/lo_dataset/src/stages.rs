//! Stages of jobs on datasets.

use lo_events::Stage;

/// Generating rooms.
pub const GENERATE_ROOMS: Stage = Stage::new("generate rooms");

/// Reading samples of a dataset.
pub const READ_SAMPLES: Stage = Stage::new("read samples");
