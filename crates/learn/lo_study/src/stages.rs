//! Stages of making a study.

use lo_events::Stage;

/// Finding rooms with a free path for the objects.
pub const FIND_PATHS: Stage = Stage::new("find paths");

/// Rendering the frames of all videos.
pub const RENDER_FRAMES: Stage = Stage::new("render frames");
