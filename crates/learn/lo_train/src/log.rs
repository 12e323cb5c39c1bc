//! The JSON-lines log of a run.

use std::collections::BTreeMap;
use std::fs::{File, OpenOptions};
use std::io::{Seek, SeekFrom, Write};
use std::path::Path;
use std::time::{Duration, Instant};

use lo_events::Figure;
use serde_json::{Value, json};

use crate::learner::Progress;
use crate::training_phase::TrainingPhase;

/// Appends lines to the log. A resumed log is first truncated to its length at the checkpoint.
pub(crate) struct Log {
    file: File,
    bytes: u64,
    mean: RunningMeans,
}

/// Sums of the losses and gradient norms since the last line.
struct RunningMeans {
    sums: BTreeMap<&'static str, (f64, u64)>,
    order: Vec<&'static str>,
    steps: u64,
    begun: Instant,
}

impl RunningMeans {
    fn new() -> Self {
        Self { sums: BTreeMap::new(), order: Vec::new(), steps: 0, begun: Instant::now() }
    }

    fn add(&mut self, name: &'static str, value: f32) {
        let sum = self.sums.entry(name).or_insert_with(|| {
            self.order.push(name);
            (0.0, 0)
        });
        *sum = (sum.0 + f64::from(value), sum.1 + 1);
    }

    fn get(&self, name: &str) -> f32 {
        self.sums.get(name).map_or(f32::NAN, |(sum, count)| (sum / *count as f64) as f32)
    }
}

impl Log {
    /// Opens the log, truncated to its first `bytes`.
    pub fn open(path: &Path, bytes: u64) -> std::io::Result<Self> {
        let mut file = OpenOptions::new().create(true).truncate(false).write(true).open(path)?;
        let bytes = bytes.min(file.metadata()?.len());
        file.set_len(bytes)?;
        file.seek(SeekFrom::End(0))?;
        Ok(Self { file, bytes, mean: RunningMeans::new() })
    }

    /// Returns the length of the log in bytes.
    pub fn bytes(&self) -> u64 {
        self.bytes
    }

    /// Writes one line.
    pub fn line(&mut self, value: &Value) -> std::io::Result<()> {
        let line = format!("{value}\n");
        self.file.write_all(line.as_bytes())?;
        self.bytes += line.len() as u64;
        Ok(())
    }

    /// Writes the line of a failed step, after which the run continues from an earlier one.
    pub fn setback(&mut self, phase: TrainingPhase, step: u64, fault: &str, back_to_step: u64) -> std::io::Result<()> {
        self.line(&json!({ "phase": phase.to_string(), "step": step, "fault": fault, "back_to_step": back_to_step }))
    }

    /// Adds the losses and norms of a step to the means.
    pub fn add(&mut self, progress: &Progress) {
        progress.losses.iter().chain(&progress.norms).for_each(|&(name, value)| self.mean.add(name, value));
        self.mean.steps += 1;
    }

    /// Returns the mean losses since the last line.
    pub fn losses(&self, progress: &Progress) -> Vec<Figure> {
        progress.losses.iter().map(|&(name, _)| Figure { name, value: self.mean.get(name).into() }).collect()
    }

    /// Resets the means, as after a rollback.
    pub fn restart(&mut self) {
        self.mean = RunningMeans::new();
    }

    /// Writes a line of the means since the last one, and resets them.
    pub fn means(
        &mut self,
        phase: TrainingPhase,
        step: u64,
        total: u64,
        learning_rate: f64,
        waited: Duration,
    ) -> std::io::Result<()> {
        let mean = std::mem::replace(&mut self.mean, RunningMeans::new());
        let (seconds, steps) = (mean.begun.elapsed().as_secs_f64(), mean.steps.max(1) as f64);
        let values: serde_json::Map<String, Value> =
            mean.order.iter().map(|&name| (name.to_owned(), json!(mean.get(name)))).collect();
        let rounded = |value: f64| (value * 1e4).round() / 1e4;
        self.line(&json!({
            "phase": phase.to_string(),
            "step": step,
            "total_steps": total,
            "learning_rate": learning_rate,
            "means": values,
            "seconds_per_step": rounded(seconds / steps),
            "waited_share": rounded(waited.as_secs_f64() / seconds.max(1e-9)),
        }))
    }
}
