//! Stages of running a depth model.

use lo_events::Stage;

/// Preparing a model for photos of one size.
pub const PREPARE_DEPTH_MODEL: Stage = Stage::new("prepare depth model");

/// Predicting depth.
pub const DEPTH_MODEL: Stage = Stage::new("depth model");
