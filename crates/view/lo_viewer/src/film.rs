//! The sequence that is being downloaded, of which there is at most one.

use std::sync::atomic::{AtomicBool, Ordering};

/// Whether a sequence is being made, and whether it is to stop.
#[derive(Default)]
pub(crate) struct Film {
    pub is_running: AtomicBool,
    pub is_stopped: AtomicBool,
}

impl Film {
    /// Stops it after the current frame.
    pub fn stop(&self) {
        self.is_stopped.store(true, Ordering::SeqCst);
    }
}
