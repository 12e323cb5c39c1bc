//! State of the running sequence download, at most one per scene.

use std::sync::atomic::{AtomicBool, Ordering};

use tokio::sync::watch;

/// Whether a sequence download is running, and whether it was asked to stop.
pub(crate) struct SequenceDownload {
    is_running: AtomicBool,
    is_stopped: watch::Sender<bool>,
}

impl Default for SequenceDownload {
    fn default() -> Self {
        Self { is_running: AtomicBool::new(false), is_stopped: watch::Sender::new(false) }
    }
}

impl SequenceDownload {
    /// Begins a download; `None` if one is running. The receiver tells whether to stop.
    pub fn begin(&self) -> Option<watch::Receiver<bool>> {
        if self.is_running.swap(true, Ordering::SeqCst) {
            return None;
        }
        self.is_stopped.send_replace(false);
        Some(self.is_stopped.subscribe())
    }

    /// Marks the download as ended.
    pub fn end(&self) {
        self.is_running.store(false, Ordering::SeqCst);
    }

    /// Cancels the download during the current frame, also if the browser takes nothing.
    pub fn stop(&self) {
        self.is_stopped.send_replace(true);
    }
}
