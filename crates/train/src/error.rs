use std::path::{Path, PathBuf};

use dataset::DatasetError;
use nets::checkpoint::CheckpointError;

/// Why a run cannot begin or go on.
#[derive(Debug, thiserror::Error)]
pub enum TrainError {
    /// A configuration out of range.
    #[error("{0}")]
    Config(String),
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
    Image(#[from] imaging::ImageError),
    /// The checkpoint is of no run, or of one that this program or configuration cannot continue.
    #[error("{}: {reason}", path.display())]
    NotThisRun {
        /// The checkpoint.
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
    #[error("step {step} of {phase}: {what}; going back to the checkpoint did not help {times} times")]
    Diverged {
        /// Which phase.
        phase: String,
        /// Which of its steps.
        step: u64,
        /// What is no number.
        what: String,
        /// How often it was tried.
        times: u32,
    },
}

impl TrainError {
    pub(crate) fn io(path: &Path) -> impl FnOnce(std::io::Error) -> Self {
        move |source| Self::Io { path: path.to_owned(), source }
    }
}
