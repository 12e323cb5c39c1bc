use std::time::{Duration, Instant};

/// What a long-running call says on its way; every front end consumes the same stream.
#[derive(Clone, Debug, PartialEq)]
pub enum Message {
    /// A stage is done.
    Stage {
        /// What was done.
        name: &'static str,
        /// How long it took.
        took: Duration,
    },
    /// Something that the user should know.
    Note(String),
}

/// Does one stage and says how long it took.
pub(crate) fn stage<T>(messages: &mut dyn FnMut(Message), name: &'static str, work: impl FnOnce() -> T) -> T {
    let begun = Instant::now();
    let result = work();
    messages(Message::Stage { name, took: begun.elapsed() });
    result
}
