use std::path::{Path, PathBuf};

use lo_dataset::DatasetError;
use lo_events::{Cancelled, TrainingPhase};
use lo_nets::checkpoint::CheckpointError;
use lo_nets::light::{LightConfigError, LightError};

/// Why a run cannot begin or go on.
#[derive(Debug, thiserror::Error)]
pub enum TrainError {
    /// A configuration out of range.
    #[error(transparent)]
    Config(#[from] ConfigError),
    /// The handler of events asked the run to end; it can be resumed.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
    /// The data cannot be opened.
    #[error(transparent)]
    Data(#[from] DatasetError),
    /// A checkpoint or file of weights cannot be read, written or used.
    #[error(transparent)]
    Checkpoint(#[from] CheckpointError),
    /// The file system refused.
    #[error("{}: {source}", path.display())]
    Io {
        /// File or folder.
        path: PathBuf,
        /// What the system says.
        source: std::io::Error,
    },
    /// The contact sheet cannot be written.
    #[error(transparent)]
    Image(#[from] lo_imaging::ImageError),
    /// The checkpoint is of no run, or of one that this program or configuration cannot continue.
    #[error("{}: {reason}", path.display())]
    NotThisRun {
        /// The checkpoint.
        path: PathBuf,
        /// What is wrong.
        reason: String,
    },
    /// A file of an encoder's weights is not what it should be.
    #[error("{}: {reason}", path.display())]
    EncoderWeights {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        reason: String,
    },
    /// No sample of the dataset can be used.
    #[error("none of {count} samples in a row can be used; the last: {last}")]
    NoSamples {
        /// How many were tried.
        count: u64,
        /// What is wrong with the last.
        last: String,
    },
    /// The dataset has no sample to train on.
    #[error("the dataset has no samples to train on")]
    Empty,
    /// Going back to the last checkpoint did not help.
    #[error("step {step} of {phase}: {fault}; going back to the checkpoint did not help {times} times")]
    Diverged {
        /// Which phase.
        phase: TrainingPhase,
        /// Which of its steps.
        step: u64,
        /// What is no number.
        fault: Fault,
        /// How often it was tried.
        times: u32,
    },
}

/// What cannot be trained.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ConfigError {
    /// A field out of its range.
    #[error("{field} is {value}; it must lie in {min} to {max}")]
    OutOfRange {
        /// Its path in the file.
        field: String,
        /// Its value.
        value: f64,
        /// The least one that is possible beside the other fields.
        min: f64,
        /// The greatest one.
        max: f64,
    },
    /// A light network that cannot be.
    #[error("network: {0}")]
    Network(#[from] LightConfigError),
    /// Rooms that cannot be generated.
    #[error("data.generator: {0}")]
    Generator(String),
    /// There is nothing to do.
    #[error("there are no phases: none of depth, light and joint is given")]
    NoPhases,
}

/// What made a step impossible: numbers that are none.
#[derive(Debug, thiserror::Error)]
pub enum Fault {
    /// Of a gradient.
    #[error("the gradient of {parameter} is not finite{}", neither(losses))]
    Gradient {
        /// The first parameter whose gradient it is.
        parameter: String,
        /// The losses that are no numbers either.
        losses: Vec<&'static str>,
    },
    /// Of the weights.
    #[error("{parameter} is not finite")]
    Weights {
        /// The first parameter.
        parameter: String,
    },
    /// Of the depth that the depth network predicts.
    #[error("depth_net's depth is not finite")]
    Depth,
    /// Of the light network's output.
    #[error("light_net: {0}")]
    Light(#[from] LightError),
}

fn neither(losses: &[&str]) -> String {
    if losses.is_empty() { String::new() } else { format!("; neither are the losses {}", losses.join(", ")) }
}

pub(crate) fn inside(field: &str, value: f64, min: f64, max: f64) -> Result<(), ConfigError> {
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
