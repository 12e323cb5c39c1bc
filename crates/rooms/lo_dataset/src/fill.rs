//! Resumable jobs that fill a folder of shards.

use std::sync::Arc;

use lo_events::{OnEvent, Steps};

use crate::prefetch::Prefetch;
use crate::shard::write_shard;
use crate::stages;
use crate::{Dataset, DatasetError, Generator, LoadError, Loader, LoaderConfig, Record, ShardFolder};

/// Maximum number of rooms that are generated in parallel. Each needs some hundred megabytes, and its ray loops use all
/// threads.
const MAX_PARALLEL_ROOMS: usize = 4;

/// The shards of a folder that one of several runs makes: every `count`-th, starting at `index`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ShardPart {
    /// Index of the run, below `count`.
    pub index: usize,
    /// Number of runs, at least 1.
    pub count: usize,
}

/// Result of a run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ShardCount {
    /// Shards of this run's part.
    pub total: usize,
    /// Finished shards of the part. Fewer than `total` if the run was cancelled.
    pub finished: usize,
    /// Shards written by this run.
    pub written: usize,
}

/// Failure of a shard job. Finished shards are kept.
#[derive(Debug, thiserror::Error)]
pub enum FillError {
    /// A sample cannot be read.
    #[error(transparent)]
    Sample(Box<LoadError>),
    /// A room cannot be generated, or a file cannot be written.
    #[error(transparent)]
    Dataset(#[from] DatasetError),
}

impl From<LoadError> for FillError {
    fn from(error: LoadError) -> Self {
        Self::Sample(Box::new(error))
    }
}

/// Generates the missing shards of these rooms, with `per_shard` (at least 1) rooms per archive.
///
/// If the handler cancels, the current shard is finished first.
///
/// # Errors
/// Error of the first room or file that fails.
///
/// # Panics
/// If `per_shard` or the number of runs is 0.
pub fn generate_shards(
    folder: &ShardFolder,
    generator: &Generator,
    rooms: &[u64],
    per_shard: usize,
    part: ShardPart,
    on_event: OnEvent<'_>,
) -> Result<ShardCount, FillError> {
    let own_shards = || rooms.chunks(per_shard).enumerate().skip(part.index).step_by(part.count);
    let todo: Vec<(usize, &[u64])> = own_shards().filter(|&(shard, _)| !folder.has(shard)).collect();
    let order: Vec<u64> = todo.iter().flat_map(|(_, rooms)| rooms.iter().copied()).collect();
    let mut steps = Steps::begin(on_event, stages::GENERATE_ROOMS, order.len());
    let parallel = rayon::current_num_threads().min(MAX_PARALLEL_ROOMS);
    let generator = generator.clone();
    let make = move |number: u64| order.get(number as usize).map(|&room| generator.record(room));
    let made = Prefetch::start(parallel, parallel, make);
    let mut written = 0;
    for &(shard, rooms) in &todo {
        if steps.cancelled() {
            break;
        }
        let records = rooms.iter().map(|_| {
            let record = made.next()?;
            steps.step();
            Ok::<_, DatasetError>(record)
        });
        write_shard(&folder.shard(shard), records, folder.generator())?;
        written += 1;
    }
    steps.end();
    let total = own_shards().count();
    Ok(ShardCount { total, finished: total - todo.len() + written, written })
}

/// Converts a dataset to shards with `per_shard` (at least 1) samples per archive, skipping finished ones. `threads`
/// threads read the samples.
///
/// If the handler cancels, the current shard is finished first.
///
/// # Errors
/// Error of the first sample or file that fails.
///
/// # Panics
/// If `per_shard` is 0.
pub fn convert_to_shards(
    folder: &ShardFolder,
    dataset: &Arc<dyn Dataset>,
    per_shard: usize,
    threads: usize,
    on_event: OnEvent<'_>,
) -> Result<ShardCount, FillError> {
    let total = dataset.len().div_ceil(per_shard);
    let todo: Vec<usize> = (0..total).filter(|&shard| !folder.has(shard)).collect();
    let samples_of = |shard: usize| shard * per_shard..dataset.len().min((shard + 1) * per_shard);
    let samples = todo.iter().map(|&shard| samples_of(shard).len()).sum();
    let mut steps = Steps::begin(on_event, stages::READ_SAMPLES, samples);
    let mut written = 0;
    // One loader per run of consecutive missing shards, so that it prefetches across shards.
    'runs: for run in todo.chunk_by(|a, b| a + 1 == *b) {
        let config = LoaderConfig { shuffle: false, threads, ..LoaderConfig::default() };
        let mut samples = Loader::from_sample(Arc::clone(dataset), config, samples_of(run[0]).start);
        for &shard in run {
            if steps.cancelled() {
                break 'runs;
            }
            let part = samples.by_ref().take(samples_of(shard).len()).map(|sample| {
                let record = Record::from(sample?);
                steps.step();
                Ok::<_, FillError>(record)
            });
            write_shard(&folder.shard(shard), part, folder.generator())?;
            written += 1;
        }
    }
    steps.end();
    Ok(ShardCount { total, finished: total - todo.len() + written, written })
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use std::borrow::Cow;
    use std::ops::ControlFlow;

    use lo_events::Event;
    use serde_json::json;

    use super::*;
    use crate::sample::tests::sample;
    use crate::{Sample, Shards};

    struct NumberedDataset(usize);

    impl Dataset for NumberedDataset {
        fn len(&self) -> usize {
            self.0
        }

        fn scene_id(&self, index: usize) -> Cow<'_, str> {
            format!("room-{index}").into()
        }

        fn get(&self, index: usize) -> Result<Sample, DatasetError> {
            Ok(Sample { id: format!("n{index}"), scene_id: format!("room-{index}"), ..sample() })
        }
    }

    #[test]
    fn a_cancelled_conversion_ends_with_a_whole_shard_and_goes_on() {
        let at = tempfile::tempdir().unwrap();
        let folder = ShardFolder::open(at.path(), "samples", &json!({ "of": "numbers" }), false).unwrap();
        let dataset: Arc<dyn Dataset> = Arc::new(NumberedDataset(7));
        let mut received = 0;
        let mut cancel = |event: Event| {
            received += u32::from(matches!(event, Event::Progress { .. }));
            // In the middle of the second shard.
            if received == 5 { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
        };
        let count = convert_to_shards(&folder, &dataset, 3, 2, &mut cancel).unwrap();
        assert_eq!(count, ShardCount { total: 3, finished: 2, written: 2 });
        let count = convert_to_shards(&folder, &dataset, 3, 1, &mut lo_events::ignore).unwrap();
        assert_eq!(count, ShardCount { total: 3, finished: 3, written: 1 });
        let shards = Shards::open(at.path()).unwrap();
        let ids = (0..shards.len()).map(|i| shards.get(i).unwrap().scene_id);
        assert!(ids.eq((0..7).map(|i| format!("room-{i}"))));
    }
}
