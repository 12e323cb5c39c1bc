use std::path::PathBuf;

use lo_nets::checkpoint::CheckpointError;

use crate::System;

/// Errors of baselines.
#[derive(Debug, thiserror::Error)]
pub enum BaselineError {
    /// The file cannot be read, or its weights do not match the network.
    #[error(transparent)]
    Checkpoint(#[from] CheckpointError),
    /// The file has no weights of a baseline.
    #[error("{}: not the weights of a baseline; lightoctree-lab train-baseline makes them", path.display())]
    NotABaseline {
        /// The file.
        path: PathBuf,
    },
    /// The file has the weights of another system.
    #[error("{}: the weights of {found}, not of {wanted}", path.display())]
    OtherSystem {
        /// The file.
        path: PathBuf,
        /// The system of the file.
        found: System,
        /// The system asked for.
        wanted: System,
    },
    /// The baseline was trained on the features of another depth network.
    #[error("{system} was trained on the image features of other weights; use the weights that it was trained with")]
    OtherFeatures {
        /// The system.
        system: System,
    },
    /// An example's file is incomplete.
    #[error("the file of a training example has no valid \"{what}\"")]
    Example {
        /// The tensor.
        what: &'static str,
    },
}
