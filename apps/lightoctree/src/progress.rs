//! Progress on stderr: a line per stage with its time, a bar with rate and time left for what has many steps.

use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressStyle};
use lightoctree::Message;

/// Speaks about the stages of one command.
pub struct Stages {
    quiet: bool,
    begun: Instant,
    done: Vec<(String, Duration)>,
}

impl Stages {
    /// Starts the clock; says nothing when `quiet`.
    pub fn new(quiet: bool) -> Self {
        Self { quiet, begun: Instant::now(), done: Vec::new() }
    }

    /// Does one stage and says how long it took.
    pub fn stage<T>(&mut self, name: &str, work: impl FnOnce() -> T) -> T {
        let begun = Instant::now();
        let result = work();
        self.done(name, begun.elapsed());
        result
    }

    /// Takes note of what the library says on its way.
    pub fn hear(&mut self, message: Message) {
        match message {
            Message::Stage { name, took } => self.done(name, took),
            Message::Note(text) => self.note(&text),
        }
    }

    /// Says something that the user should know.
    pub fn note(&self, text: &str) {
        if !self.quiet {
            eprintln!("  note: {text}");
        }
    }

    /// Name → seconds of every stage so far.
    pub fn timings(&self) -> serde_json::Map<String, serde_json::Value> {
        self.done.iter().map(|(name, took)| (name.clone(), took.as_secs_f64().into())).collect()
    }

    fn done(&mut self, name: &str, took: Duration) {
        if !self.quiet {
            eprintln!("  {name:<28} {}", seconds(took));
        }
        self.done.push((name.to_owned(), took));
    }

    /// Time since the beginning.
    pub fn total(&self) -> Duration {
        self.begun.elapsed()
    }
}

/// `12 ms`, `1.24 s`.
pub fn seconds(duration: Duration) -> String {
    let s = duration.as_secs_f64();
    if s < 1.0 { format!("{:.0} ms", 1e3 * s) } else { format!("{s:.2} s") }
}

/// A bar for `count` steps with rate and time left; hidden when `quiet` or when stderr is no terminal.
pub fn bar(quiet: bool, count: usize, what: &str) -> ProgressBar {
    if quiet {
        return ProgressBar::hidden();
    }
    let style = ProgressStyle::with_template("  {msg} {wide_bar} {pos}/{len}  {per_sec}  {eta} left")
        .unwrap_or_else(|_| ProgressStyle::default_bar());
    ProgressBar::new(count as u64).with_style(style).with_message(what.to_owned())
}
