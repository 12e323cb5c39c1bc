use std::panic::{AssertUnwindSafe, catch_unwind};

use lightoctree::Event;
use lo_session::SessionError;

/// A job failed.
pub(crate) enum Failure {
    Session(SessionError),
    /// The job panicked.
    Panic,
}

impl std::fmt::Display for Failure {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Session(error) => error.fmt(f),
            Self::Panic => f.write_str("internal error; see the terminal output"),
        }
    }
}

/// Runs a job and turns a panic into a failure, so that the server keeps running.
pub(crate) fn guarded<T>(work: impl FnOnce() -> Result<T, SessionError>) -> Result<T, Failure> {
    catch_unwind(AssertUnwindSafe(work)).map_err(|_| Failure::Panic)?.map_err(Failure::Session)
}

/// Returns the stage of an event.
pub(crate) fn stage_of(event: &Event) -> Option<&lightoctree::Stage> {
    match event {
        Event::Begun(stage) | Event::Progress { stage, .. } | Event::Done { stage, .. } => Some(stage),
        _ => None,
    }
}
