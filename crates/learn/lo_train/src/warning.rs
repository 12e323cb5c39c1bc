use std::fmt;

use lo_events::Warning;

use crate::training_phase::TrainingPhase;

/// Warnings of training.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum TrainingWarning {
    /// An unusable sample of a dataset was skipped.
    SampleSkipped {
        /// Name of the sample, or its index in the dataset.
        sample: String,
        /// Error of reading it.
        error: String,
    },
    /// The encoder's initial weights are not the published file: they were converted or trained differently.
    UnpublishedEncoder {
        /// File name.
        file: String,
        /// SHA-256 of the file, in hexadecimal.
        sha256: String,
    },
    /// The dataset differs from the one that the run was started with: the next epoch begins.
    DatasetChanged {
        /// Epoch that begins.
        epoch: u64,
    },
    /// Training met NaN or infinite values and went back to its last checkpoint, to continue with other data.
    SetBack {
        /// Training phase.
        phase: TrainingPhase,
        /// Step of the phase at which that happened.
        step: u64,
        /// Name of the value that is NaN or infinite.
        fault: String,
        /// Step of the checkpoint.
        back_to_step: u64,
    },
}

impl Warning for TrainingWarning {}

impl fmt::Display for TrainingWarning {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        match self {
            Self::SampleSkipped { sample, error } => write!(f, "skipped {sample}: {error}"),
            Self::UnpublishedEncoder { file, sha256 } => {
                write!(f, "{file} is not the published file of encoder weights; its SHA-256 is {sha256}")
            }
            Self::DatasetChanged { .. } => f.write_str("the dataset has changed; the next epoch begins"),
            Self::SetBack { phase, step, fault, back_to_step } => {
                write!(f, "{phase}, step {step}: {fault}; continuing from step {back_to_step} with other data")
            }
        }
    }
}
