//! Examples made ahead by a thread of their own.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::sync::mpsc::{Receiver, sync_channel};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use lo_dataset::{Dataset, LoadError, Loader, LoaderConfig, LoaderState, Sample, Split};

use crate::config::DataConfig;
use crate::example::Unusable;

/// What a sample became, where it stands, and where the loader stands after it.
pub(crate) struct Fed<T> {
    pub at: LoaderState,
    pub example: Result<T, PassedOver>,
    pub next: LoaderState,
}

/// A sample that cannot be used, and why.
#[derive(Debug)]
pub(crate) struct PassedOver {
    pub sample: String,
    pub error: String,
}

/// Goes through the training part of a dataset without end and prepares each sample, in order.
pub(crate) struct Feed<T> {
    receiver: Option<Receiver<Fed<T>>>,
    thread: Option<JoinHandle<()>>,
    waited: Duration,
}

/// The dataset gave nothing more.
#[derive(Debug)]
pub(crate) struct Exhausted;

impl<T: Send + 'static> Feed<T> {
    /// Begins with single samples that a loader gave out before, then where it stands. `prepare` is given the epoch too.
    pub fn start(
        dataset: Arc<dyn Dataset>,
        data: &DataConfig,
        seed: u64,
        first: Vec<LoaderState>,
        state: LoaderState,
        mut prepare: impl FnMut(&Sample, u64) -> Result<T, Unusable> + Send + 'static,
    ) -> std::io::Result<Self> {
        let config = LoaderConfig {
            seed,
            shuffle: true,
            split: Some(Split::Train),
            epochs: None,
            threads: data.threads,
            prefetch: data.prefetch,
        };
        let (sender, receiver) = sync_channel(data.prefetch);
        // A pool of its own: the trainer's threads must not wait for what is prepared, nor the other way round.
        let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().map_err(std::io::Error::other)?;
        let work = move || {
            let mut feed = |at: LoaderState, sample: Result<Sample, LoadError>, next| {
                let unreadable =
                    |error: LoadError| PassedOver { sample: error.scene_id, error: error.source.to_string() };
                let example = sample.map_err(unreadable).and_then(|sample| {
                    pool.install(|| prepare(&sample, at.epoch))
                        .map_err(|error| PassedOver { sample: sample.id, error: error.to_string() })
                });
                sender.send(Fed { at, example, next }).is_ok()
            };
            let alone = LoaderConfig { threads: 1, prefetch: 1, ..config };
            for at in first {
                let Some(sample) = Loader::resume(dataset.clone(), alone, at).next() else { return };
                if !feed(at, sample, state) {
                    return;
                }
            }
            let mut loader = Loader::resume(dataset, config, state);
            loop {
                let at = loader.state();
                let Some(sample) = loader.next() else { return };
                if !feed(at, sample, loader.state()) {
                    return;
                }
            }
        };
        let thread = std::thread::Builder::new().name("examples".into()).spawn(work)?;
        Ok(Self { receiver: Some(receiver), thread: Some(thread), waited: Duration::ZERO })
    }

    /// Waits for the next one. A panic of the preparing thread goes on here.
    pub fn next(&mut self) -> Result<Fed<T>, Exhausted> {
        let begun = Instant::now();
        let fed = self.receiver.as_ref().ok_or(Exhausted)?.recv();
        self.waited += begun.elapsed();
        fed.map_err(|_| {
            self.receiver = None;
            if let Some(Err(panic)) = self.thread.take().map(JoinHandle::join) {
                std::panic::resume_unwind(panic);
            }
            Exhausted
        })
    }

    /// Time spent waiting since this was last asked.
    pub fn take_waited(&mut self) -> Duration {
        std::mem::take(&mut self.waited)
    }
}

/// How many batches' examples wait for others of their size before a batch is not filled.
const MAX_WAITING: usize = 8;

/// Examples on their way into batches of one size: what has no company yet waits.
pub(crate) struct Batches<T> {
    batch_size: usize,
    waiting: Vec<(LoaderState, [usize; 2], T)>,
}

impl<T> Batches<T> {
    pub fn new(batch_size: usize) -> Self {
        Self { batch_size, waiting: Vec::new() }
    }

    /// Adds an example; gives the batch that it completes. Where there are so many sizes that none does, what waits of the commonest one is a batch.
    pub fn add(&mut self, at: LoaderState, size: [usize; 2], example: T) -> Option<Vec<T>> {
        self.waiting.push((at, size, example));
        let mut counts = BTreeMap::new();
        self.waiting.iter().for_each(|(_, size, _)| *counts.entry(*size).or_insert(0) += 1);
        let (commonest, count) = counts.into_iter().max_by_key(|&(_, count)| count)?;
        if count < self.batch_size && self.waiting.len() < MAX_WAITING * self.batch_size {
            return None;
        }
        let batch = self.waiting.extract_if(.., |(_, size, _)| *size == commonest);
        Some(batch.map(|(_, _, example)| example).collect())
    }

    /// Where the examples stand that wait.
    pub fn waiting(&self) -> Vec<LoaderState> {
        self.waiting.iter().map(|&(at, ..)| at).collect()
    }
}

impl<T> Drop for Feed<T> {
    fn drop(&mut self) {
        // Its next attempt to send ends the thread.
        self.receiver = None;
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    /// Positions of a loader, one after the other.
    fn at(block: u64) -> LoaderState {
        LoaderState { block, ..LoaderState::default() }
    }

    /// Every third photo stands upright.
    fn size(number: u64) -> [usize; 2] {
        if number.is_multiple_of(3) { [2, 3] } else { [3, 2] }
    }

    #[test]
    fn a_batch_has_one_size_and_nothing_is_lost() {
        let mut batches = Batches::new(4);
        let made: Vec<Vec<u64>> = (0..16).filter_map(|i| batches.add(at(i), size(i), i)).collect();
        assert_eq!(made, [vec![1, 2, 4, 5], vec![0, 3, 6, 9], vec![7, 8, 10, 11]]);
        assert_eq!(batches.waiting(), [12, 13, 14, 15].map(at));
        // what waits comes first when a run goes on
        let mut resumed = Batches::new(4);
        for batches in [&mut batches, &mut resumed] {
            let held = if batches.waiting().is_empty() { 12 } else { 16 };
            let made: Vec<Vec<u64>> = (held..24).filter_map(|i| batches.add(at(i), size(i), i)).collect();
            assert_eq!(made, [vec![13, 14, 16, 17], vec![12, 15, 18, 21], vec![19, 20, 22, 23]]);
        }
    }

    #[test]
    fn single_examples_do_not_wait_and_many_sizes_do_not_wait_for_ever() {
        let mut single = Batches::new(1);
        assert!((0..5).all(|i| single.add(at(i), [i as usize; 2], i) == Some(vec![i])));
        let mut many = Batches::new(3);
        let made: Vec<Vec<u64>> = (0..30).filter_map(|i| many.add(at(i), [i as usize / 2; 2], i)).collect();
        assert_eq!(made[0].len(), 2, "{made:?}");
        assert!(many.waiting().len() < 3 * MAX_WAITING);
    }
}
