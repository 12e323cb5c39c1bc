//! Progress bar of a long job, on stderr.

use std::ops::ControlFlow;

use indicatif::ProgressBar;
use lightoctree::Event;
use lightoctree_cli::interrupt;
use lightoctree_cli::progress::bar;

/// Shows the current stage as a progress bar, and cancels the job after Ctrl-C.
pub struct StageBar {
    quiet: bool,
    bar: ProgressBar,
}

impl StageBar {
    /// Creates a bar without a stage; prints nothing if `quiet`.
    pub fn new(quiet: bool) -> Self {
        Self { quiet, bar: ProgressBar::hidden() }
    }

    /// Handles an event of the job.
    pub fn handle(&mut self, event: Event) -> ControlFlow<()> {
        match event {
            Event::Progress { stage, done: 0, total } => {
                self.bar.finish_and_clear();
                self.bar = bar(self.quiet, total as usize, stage.name());
            }
            Event::Progress { done, .. } => self.bar.set_position(done),
            Event::Warning(warning) if !self.quiet => {
                self.bar.suspend(|| eprintln!("  note: {warning}"));
            }
            _ => {}
        }
        interrupt::control_flow()
    }
}

impl Drop for StageBar {
    fn drop(&mut self) {
        self.bar.finish_and_clear();
    }
}
