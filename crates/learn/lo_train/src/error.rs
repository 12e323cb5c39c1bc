use std::path::{Path, PathBuf};

use lo_dataset::DatasetError;
use lo_events::Cancelled;
use lo_nets::checkpoint::CheckpointError;
use lo_nets::light::{LightConfigError, LightError};

use crate::training_phase::TrainingPhase;

/// Errors of a training run.
#[derive(Debug, thiserror::Error)]
pub enum TrainError {
    /// The configuration is invalid.
    #[error(transparent)]
    Config(#[from] ConfigError),
    /// The event handler cancelled the run; it can be resumed.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
    /// A dataset cannot be opened.
    #[error(transparent)]
    Data(#[from] DatasetError),
    /// A checkpoint or weights file cannot be read or written, or does not fit.
    #[error(transparent)]
    Checkpoint(#[from] CheckpointError),
    /// A file operation failed.
    #[error("{}: {source}", path.display())]
    Io {
        /// File or folder.
        path: PathBuf,
        /// The system's error.
        source: std::io::Error,
    },
    /// The contact sheet cannot be written.
    #[error(transparent)]
    Image(#[from] lo_imaging::ImageError),
    /// The file does not belong to a run that this program and configuration can continue or start from.
    #[error("{}: {reason}", path.display())]
    NotThisRun {
        /// The checkpoint or weights file.
        path: PathBuf,
        /// The mismatch.
        reason: String,
    },
    /// A file of encoder weights is damaged or unreadable.
    #[error("{}: {reason}", path.display())]
    EncoderWeights {
        /// The file.
        path: PathBuf,
        /// The mismatch.
        reason: String,
    },
    /// Too many consecutive samples cannot be used.
    #[error("{count} consecutive samples cannot be used; the last: {last}")]
    NoSamples {
        /// Samples tried.
        count: u64,
        /// The last sample and its problem.
        last: String,
    },
    /// The dataset has no training samples.
    #[error("the dataset has no training samples")]
    Empty,
    /// Training diverged repeatedly after the same checkpoint.
    #[error(
        "{phase}, step {step}: {cause}; training diverged again after {times} rollbacks to the last checkpoint, \
        try a lower learning_rate"
    )]
    Diverged {
        /// The phase.
        phase: TrainingPhase,
        /// Its step.
        step: u64,
        /// Why the step failed.
        cause: StepError,
        /// Rollbacks to the checkpoint.
        times: u32,
    },
}

/// Errors of a configuration.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ConfigError {
    /// A field is out of range.
    #[error("{field} is {value}; it must be between {min} and {max}")]
    OutOfRange {
        /// Path of the field in the file.
        field: String,
        /// Its value.
        value: f64,
        /// Smallest valid value, given the other fields.
        min: f64,
        /// Largest valid value.
        max: f64,
    },
    /// The shape of the light network is invalid.
    #[error("network: {0}")]
    Network(#[from] LightConfigError),
    /// The room generator's configuration is invalid.
    #[error("data.generator: {0}")]
    Generator(String),
    /// The configuration has no phases.
    #[error("no training phases: add at least one of [[depth]], [[light]], [[joint]] and [[expected]]")]
    NoPhases,
}

/// Errors of a training step: NaN or infinite values.
#[derive(Debug, thiserror::Error)]
pub enum StepError {
    /// A gradient is not finite.
    #[error("the gradient of {parameter} is not finite{}", list_losses(losses))]
    Gradient {
        /// First parameter with such a gradient.
        parameter: String,
        /// Losses that are not finite either.
        losses: Vec<&'static str>,
    },
    /// A weight is not finite.
    #[error("{parameter} is not finite")]
    Weights {
        /// First parameter with such a weight.
        parameter: String,
    },
    /// Predicted depth is not finite.
    #[error("the depth predicted by depth_net is not finite")]
    Depth,
    /// The light network's output is invalid.
    #[error("light_net: {0}")]
    Light(#[from] LightError),
}

fn list_losses(losses: &[&str]) -> String {
    if losses.is_empty() { String::new() } else { format!("; non-finite losses: {}", losses.join(", ")) }
}

/// Checks that a field is between `min` and `max`.
pub(crate) fn check_range(field: &str, value: f64, min: f64, max: f64) -> Result<(), ConfigError> {
    match (min..=max).contains(&value) {
        true => Ok(()),
        false => Err(ConfigError::OutOfRange { field: field.to_owned(), value, min, max }),
    }
}

impl TrainError {
    pub(crate) fn io(path: &Path) -> impl FnOnce(std::io::Error) -> Self {
        move |source| Self::Io { path: path.to_owned(), source }
    }
}
