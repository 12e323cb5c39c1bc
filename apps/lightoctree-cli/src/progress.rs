//! Progress on stderr: a line with the time of each stage, and a bar with rate and remaining time for long ones.

use std::ops::ControlFlow;
use std::path::Path;
use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressStyle};
use lightoctree::{Event, Warning};
use lo_estimate::stages::PHOTOS;
use lo_events::Figure;
use lo_imaging::PhotoFile;

use crate::depth_units::DepthUnits;
use crate::interrupt;
use crate::warning_text::warning_text;

/// Reports the stages of one command.
pub struct Stages {
    quiet: bool,
    start: Instant,
    done: Vec<(String, Duration)>,
    /// Bar of the current stage, once it reports progress.
    bar: Option<ProgressBar>,
    /// Names of the inserted objects, for warnings.
    objects: Vec<String>,
    /// Units of the given depth map, for warnings.
    depth: Option<DepthUnits>,
}

impl Stages {
    /// Starts the clock. Prints nothing if `quiet`.
    pub fn new(quiet: bool) -> Self {
        Self { quiet, start: Instant::now(), done: Vec::new(), bar: None, objects: Vec::new(), depth: None }
    }

    /// Whether progress and notes are suppressed.
    pub fn is_quiet(&self) -> bool {
        self.quiet
    }

    /// Sets the names of the inserted objects; warnings use them if there are several.
    pub fn name_objects(&mut self, names: &[String]) {
        self.objects = names.to_vec();
    }

    /// Sets the units of the given depth map, for warnings about its scale.
    pub fn set_depth_units(&mut self, units: DepthUnits) {
        self.depth = Some(units);
    }

    /// Runs a stage and reports its time.
    pub fn stage<T>(&mut self, name: &str, work: impl FnOnce() -> T) -> T {
        let start = Instant::now();
        let result = work();
        self.done(name, start.elapsed());
        result
    }

    /// Handles an event of the library. Returns `Break` after a Ctrl-C.
    pub fn handle(&mut self, event: Event) -> ControlFlow<()> {
        match event {
            Event::Progress { stage, done, total } => {
                let quiet = self.quiet;
                let bar = self.bar.get_or_insert_with(|| bar(quiet, total as usize, stage.name()));
                bar.set_position(done);
            }
            Event::Done { stage, took } => {
                self.clear_bar();
                self.done(stage.name(), took);
            }
            Event::Warning(warning) => self.warn(&*warning),
            Event::Figures { stage, figures } if stage == PHOTOS => self.note(&exposures_text(&figures)),
            // Stages are reported when they are done.
            _ => {}
        }
        if interrupt::requested() {
            self.clear_bar();
        }
        interrupt::control_flow()
    }

    /// Removes the bar of an unfinished stage.
    pub fn clear_bar(&mut self) {
        self.bar.take().iter().for_each(ProgressBar::finish_and_clear);
    }

    /// Prints a warning of the library.
    pub fn warn(&self, warning: &dyn Warning) {
        let mut text = warning_text(warning, &self.objects);
        text.extend(self.depth.zip(warning.downcast_ref()).and_then(|(units, warning)| units.hint(warning)));
        self.note(&text);
    }

    /// Prints the notes about photos' files.
    pub fn photo_notes<'a>(&self, photos: impl IntoIterator<Item = (&'a Path, &'a PhotoFile)>) {
        for (path, photo) in photos {
            photo.notes.iter().for_each(|note| self.note(&format!("{}: {note}", path.display())));
        }
    }

    /// Prints a note.
    pub fn note(&self, text: &str) {
        if !self.quiet {
            eprintln!("  note: {text}");
        }
    }

    /// Returns the seconds of each finished stage by its name.
    pub fn timings(&self) -> serde_json::Map<String, serde_json::Value> {
        self.done.iter().map(|(name, took)| (name.clone(), took.as_secs_f64().into())).collect()
    }

    fn done(&mut self, name: &str, took: Duration) {
        if !self.quiet {
            eprintln!("  {name:<28} {}", seconds(took));
        }
        self.done.push((name.to_owned(), took));
    }

    /// Time since the start.
    pub fn total(&self) -> Duration {
        self.start.elapsed()
    }
}

/// Formats the matched exposures of several photos.
fn exposures_text(figures: &[Figure]) -> String {
    let stops: Vec<String> = figures.iter().map(|figure| format!("{:+.2}", figure.value)).collect();
    format!("matched exposures, relative to the first photo: {} EV", stops.join(", "))
}

/// Formats a duration, such as `12 ms` or `1.24 s`.
pub fn seconds(duration: Duration) -> String {
    let s = duration.as_secs_f64();
    if s < 1.0 { format!("{:.0} ms", 1e3 * s) } else { format!("{s:.2} s") }
}

/// Creates a bar for `count` steps with rate and remaining time. It is hidden if `quiet`, or if stderr is not a
/// terminal.
pub fn bar(quiet: bool, count: usize, label: &str) -> ProgressBar {
    if quiet {
        return ProgressBar::hidden();
    }
    let style = ProgressStyle::with_template("  {msg} {wide_bar} {pos}/{len}  {per_sec}  {eta} left")
        .unwrap_or_else(|_| ProgressStyle::default_bar());
    ProgressBar::new(count as u64).with_style(style).with_message(label.to_owned())
}

#[cfg(test)]
mod tests {
    use lo_estimate::stages::LIGHT_NETWORK;

    use super::*;

    #[test]
    fn stages_of_the_library_are_in_the_timings() {
        let mut stages = Stages::new(true);
        let took = Duration::from_millis(250);
        assert_eq!(stages.handle(Event::Done { stage: LIGHT_NETWORK, took }), ControlFlow::Continue(()));
        assert_eq!(stages.timings()["light network"], 0.25);
    }
}
