use serde::{Deserialize, Serialize};

use crate::{DatasetError, Split};

/// Options of a [`Loader`](crate::Loader).
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct LoaderConfig {
    /// Seed of the order.
    pub seed: u64,
    /// Whether each epoch has a new random order. Otherwise the dataset's own order is used.
    pub shuffle: bool,
    /// Restricts the samples to one split.
    pub split: Option<Split>,
    /// Number of epochs. Infinite if `None`.
    pub epochs: Option<u64>,
    /// Threads that make or read samples, at least 1. They affect only the speed.
    pub threads: usize,
    /// Maximum number of prefetched [blocks](crate::Dataset::block), at least the number of threads.
    #[serde(alias = "ahead")]
    pub prefetch: usize,
}

impl Default for LoaderConfig {
    fn default() -> Self {
        Self { seed: 0, shuffle: true, split: None, epochs: Some(1), threads: 2, prefetch: 4 }
    }
}

/// Position of a loader. Saved with a training run, it resumes after the last returned sample. Valid for the same
/// dataset, seed, shuffling and split.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct LoaderState {
    /// Completed epochs.
    pub epoch: u64,
    /// Completed blocks of this epoch.
    pub block: u64,
    /// Completed samples of the next block.
    pub sample: u64,
}

/// Failure to make a sample.
#[derive(Debug, thiserror::Error)]
#[error("sample {index} (scene {scene_id}): {source}")]
pub struct LoadError {
    /// Index in the dataset.
    pub index: usize,
    /// Scene of the sample.
    pub scene_id: String,
    /// Cause.
    pub source: DatasetError,
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn a_configuration_with_the_former_name_is_read() {
        let text = serde_json::to_string(&LoaderConfig { prefetch: 7, ..LoaderConfig::default() }).unwrap();
        let former = text.replace("prefetch", "ahead");
        assert_ne!(text, former);
        assert_eq!(serde_json::from_str::<LoaderConfig>(&former).unwrap().prefetch, 7);
    }
}
