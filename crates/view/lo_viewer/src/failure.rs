use std::panic::{AssertUnwindSafe, catch_unwind};

use lightoctree::Event;
use lo_session::SessionError;

/// Why there is no result.
pub(crate) enum Failure {
    Session(SessionError),
    /// A panic.
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

/// One picture's failure is not the program's end.
pub(crate) fn guarded<T>(work: impl FnOnce() -> Result<T, SessionError>) -> Result<T, Failure> {
    catch_unwind(AssertUnwindSafe(work)).map_err(|_| Failure::Panic)?.map_err(Failure::Session)
}

/// The stage that an event is of.
pub(crate) fn stage_of(event: &Event) -> Option<&lightoctree::Stage> {
    match event {
        Event::Begun(stage) | Event::Progress { stage, .. } | Event::Done { stage, .. } => Some(stage),
        _ => None,
    }
}
