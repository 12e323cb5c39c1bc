//! The input of a training run beside its configuration, and the names of its files.

use std::path::Path;

/// Complete training state, read by `--resume`.
pub const CHECKPOINT_FILE: &str = "checkpoint.safetensors";
/// Averaged weights in 16 bits, read by estimation.
pub const WEIGHTS_FILE: &str = "weights.safetensors";
/// JSON lines: averaged losses, validations and rollbacks.
pub const LOG_FILE: &str = "log.jsonl";
/// Contact sheet of the last validation.
pub const SHEET_FILE: &str = "sheet.png";

/// Input of a run beside its configuration.
#[derive(Clone, Copy, Debug)]
pub struct TrainRequest<'a> {
    /// Folder of the run's files; must exist.
    pub folder: &'a Path,
    /// Whether to continue from the folder's checkpoint.
    pub resume: bool,
    /// Seed of all random choices. A resumed run keeps its own.
    pub seed: u64,
    /// Initial weights of a new run; ignored by a resumed one.
    pub start: InitialWeights<'a>,
}

/// Weights that a run starts from. Networks that the file lacks start at random.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum InitialWeights<'a> {
    /// Random weights for all networks.
    Random,
    /// Published weights of the configured encoder, in a file that [`read_encoder`](crate::read_encoder) accepts.
    Encoder(&'a Path),
    /// The depth network of trained weights, including its global lighting decoder.
    DepthNetwork(&'a Path),
    /// All networks of trained weights.
    Networks(&'a Path),
}
