//! Jobs that fill a folder of shards, and that can be stopped and repeated.

use std::sync::Arc;

use lo_events::{OnEvent, Stage, Steps};

use crate::prefetch::Prefetch;
use crate::shard::write_shard;
use crate::{Dataset, DatasetError, Generator, LoadError, Loader, LoaderConfig, Record, ShardFolder};

/// Rooms that are made at a time, where there are as many threads: each of them needs some hundred megabytes, and the loops over its rays use all threads.
const MAX_ROOMS_AT_A_TIME: usize = 4;

/// The part of a folder's shards that one of several runs makes: every `of`-th, from number `first` on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ShardPart {
    /// Below `of`.
    pub first: usize,
    /// Runs, at least 1.
    pub of: usize,
}

/// What a run did for a folder of shards.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ShardCount {
    /// Shards of its part.
    pub all: usize,
    /// Those of them that are there now: fewer than all where the run was cancelled.
    pub there: usize,
    /// Those that it wrote.
    pub written: usize,
}

/// Why a folder of shards could not be filled. The shards that were finished are there.
#[derive(Debug, thiserror::Error)]
pub enum FillError {
    /// A sample cannot be read.
    #[error(transparent)]
    Sample(Box<LoadError>),
    /// A room cannot be generated, or a file not be written.
    #[error(transparent)]
    Dataset(#[from] DatasetError),
}

impl From<LoadError> for FillError {
    fn from(error: LoadError) -> Self {
        Self::Sample(Box::new(error))
    }
}

/// Generates these rooms, `per_shard` (at least 1) in an archive, where their archive is not there yet.
///
/// Where the handler asks for the end, the shard in hand is finished first.
///
/// # Errors
/// Of the first room or file that fails.
///
/// # Panics
/// Where `per_shard` or the number of runs is 0.
pub fn generate_shards(
    folder: &ShardFolder,
    generator: &Generator,
    rooms: &[u64],
    per_shard: usize,
    part: ShardPart,
    on_event: OnEvent<'_>,
) -> Result<ShardCount, FillError> {
    let mine = || rooms.chunks(per_shard).enumerate().skip(part.first).step_by(part.of);
    let todo: Vec<(usize, &[u64])> = mine().filter(|&(shard, _)| !folder.has(shard)).collect();
    let in_turn: Vec<u64> = todo.iter().flat_map(|(_, rooms)| rooms.iter().copied()).collect();
    let mut steps = Steps::begin(on_event, Stage::GenerateRooms, in_turn.len());
    let at_a_time = rayon::current_num_threads().min(MAX_ROOMS_AT_A_TIME);
    let generator = generator.clone();
    let make = move |number: u64| in_turn.get(number as usize).map(|&room| generator.record(room));
    let made = Prefetch::start(at_a_time, at_a_time, make);
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
    let all = mine().count();
    Ok(ShardCount { all, there: all - todo.len() + written, written })
}

/// Writes a dataset's samples, `per_shard` (at least 1) in an archive, where their archive is not there yet; `threads` read them.
///
/// Where the handler asks for the end, the shard in hand is finished first.
///
/// # Errors
/// Of the first sample or file that fails.
///
/// # Panics
/// Where `per_shard` is 0.
pub fn convert_to_shards(
    folder: &ShardFolder,
    dataset: &Arc<dyn Dataset>,
    per_shard: usize,
    threads: usize,
    on_event: OnEvent<'_>,
) -> Result<ShardCount, FillError> {
    let all = dataset.len().div_ceil(per_shard);
    let todo: Vec<usize> = (0..all).filter(|&shard| !folder.has(shard)).collect();
    let samples_of = |shard: usize| shard * per_shard..dataset.len().min((shard + 1) * per_shard);
    let total = todo.iter().map(|&shard| samples_of(shard).len()).sum();
    let mut steps = Steps::begin(on_event, Stage::ReadSamples, total);
    let mut written = 0;
    // one loader for each run of missing shards, so that it reads ahead from one shard into the next
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
    Ok(ShardCount { all, there: all - todo.len() + written, written })
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

    struct Numbers(usize);

    impl Dataset for Numbers {
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
        let dataset: Arc<dyn Dataset> = Arc::new(Numbers(7));
        let mut heard = 0;
        let mut cancel = |event: Event| {
            heard += u32::from(matches!(event, Event::Progress { .. }));
            // in the middle of the second shard
            if heard == 5 { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
        };
        let count = convert_to_shards(&folder, &dataset, 3, 2, &mut cancel).unwrap();
        assert_eq!(count, ShardCount { all: 3, there: 2, written: 2 });
        let count = convert_to_shards(&folder, &dataset, 3, 1, &mut lo_events::ignore).unwrap();
        assert_eq!(count, ShardCount { all: 3, there: 3, written: 1 });
        let shards = Shards::open(at.path()).unwrap();
        let ids = (0..shards.len()).map(|i| shards.get(i).unwrap().scene_id);
        assert!(ids.eq((0..7).map(|i| format!("room-{i}"))));
    }
}
