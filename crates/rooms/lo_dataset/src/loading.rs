use serde::{Deserialize, Serialize};

use crate::{DatasetError, Split};

/// What a loader goes through and how.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct LoaderConfig {
    /// Seed of the order.
    pub seed: u64,
    /// Another order for every epoch, or the dataset's own.
    pub shuffle: bool,
    /// Only samples of this part.
    pub split: Option<Split>,
    /// How many times through the dataset; without end where `None`.
    pub epochs: Option<u64>,
    /// Threads that make or read samples, at least 1. They change nothing but the speed.
    pub threads: usize,
    /// Most [blocks](crate::Dataset::block) made ahead, at least the threads.
    #[serde(alias = "ahead")]
    pub prefetch: usize,
}

impl Default for LoaderConfig {
    fn default() -> Self {
        Self { seed: 0, shuffle: true, split: None, epochs: Some(1), threads: 2, prefetch: 4 }
    }
}

/// Where a loader stands: saved with a training run, it goes on with the sample after the last one that was given out. Holds for the same
/// dataset, seed, shuffling and split.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct LoaderState {
    /// How many times through the dataset already.
    pub epoch: u64,
    /// Blocks of this epoch that are done.
    pub block: u64,
    /// Samples of the next block that are done.
    pub sample: u64,
}

/// A sample that could not be made, and which.
#[derive(Debug, thiserror::Error)]
#[error("sample {index} (scene {scene_id}): {source}")]
pub struct LoadError {
    /// Its index in the dataset.
    pub index: usize,
    /// Its scene.
    pub scene_id: String,
    /// What went wrong.
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
