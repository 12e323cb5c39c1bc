//! Progress of a run on stderr: a bar, or lines where no terminal shows it, as in the log of a cluster job.

use std::time::{Duration, Instant};

use indicatif::ProgressBar;

use super::record::Record;
use crate::progress::bar;
use crate::report;

/// Time between two lines.
const INTERVAL: Duration = Duration::from_secs(30);

/// Shows how many photos are done, and those that failed.
pub struct Progress {
    quiet: bool,
    bar: ProgressBar,
    total: usize,
    done: usize,
    failed: usize,
    begun: Instant,
    /// Time of the last line.
    last: Instant,
}

impl Progress {
    /// Starts the clock for `total` photos. Prints nothing if `quiet`.
    pub fn new(quiet: bool, total: usize) -> Self {
        let begun = Instant::now();
        Self { quiet, bar: bar(quiet, total, "photos"), total, done: 0, failed: 0, begun, last: begun }
    }

    /// Counts a photo.
    pub fn add(&mut self, record: &Record) {
        self.done += 1;
        self.bar.set_position(self.done as u64);
        if let Some(error) = &record.error {
            self.failed += 1;
            if !self.quiet {
                self.bar.suspend(|| eprintln!("  failed: {}: {error}", record.photo));
            }
        }
        if !self.quiet && self.bar.is_hidden() && self.last.elapsed() >= INTERVAL {
            self.last = Instant::now();
            eprintln!("  {}", line(self.done, self.total, self.failed, self.begun.elapsed()));
        }
    }

    /// Removes the bar.
    pub fn finish(&self) {
        self.bar.finish_and_clear();
    }
}

/// Formats the state of a run, with rate and remaining time.
fn line(done: usize, total: usize, failed: usize, elapsed: Duration) -> String {
    let per_s = done as f64 / elapsed.as_secs_f64();
    let left_min = (total - done) as f64 / per_s / 60.0;
    let failed = if failed > 0 { format!(", {failed} failed") } else { String::new() };
    format!("{done} of {}{failed}, {per_s:.2} per second, {left_min:.0} min left", report::counted(total, "photo"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_have_rate_and_time_left() {
        let elapsed = Duration::from_secs(100);
        assert_eq!(line(200, 1400, 0, elapsed), "200 of 1400 photos, 2.00 per second, 10 min left");
        assert_eq!(line(50, 50, 3, elapsed), "50 of 50 photos, 3 failed, 0.50 per second, 0 min left");
    }
}
