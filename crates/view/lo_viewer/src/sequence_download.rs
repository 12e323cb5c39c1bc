//! State of the running sequence download, at most one per scene.

use std::sync::atomic::{AtomicBool, Ordering};

/// Whether a sequence download is running, and whether it was asked to stop.
#[derive(Default)]
pub(crate) struct SequenceDownload {
    pub is_running: AtomicBool,
    pub is_stopped: AtomicBool,
}

impl SequenceDownload {
    /// Cancels the download during the current frame.
    pub fn stop(&self) {
        self.is_stopped.store(true, Ordering::SeqCst);
    }
}
