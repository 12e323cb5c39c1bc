//! Prepares examples ahead of the training steps, on a background thread.

use std::sync::Arc;
use std::sync::mpsc::{Receiver, sync_channel};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use lo_dataset::{Dataset, LoadError, Loader, LoaderConfig, LoaderState, Sample, Split};

use crate::config::DataConfig;
use crate::example::UnusableSample;

/// A prepared sample with its position in the dataset.
pub(crate) struct PreparedSample<T> {
    /// Loader position of this sample.
    pub at: LoaderState,
    pub example: Result<T, SkippedSample>,
    /// Loader position after this sample.
    pub next: LoaderState,
}

/// A sample that cannot be used, and why.
#[derive(Debug)]
pub(crate) struct SkippedSample {
    pub sample: String,
    pub error: String,
}

/// Iterates endlessly over the training part of a dataset and prepares the samples in order.
pub(crate) struct Prefetcher<T> {
    receiver: Option<Receiver<PreparedSample<T>>>,
    thread: Option<JoinHandle<()>>,
    waited: Duration,
}

/// The dataset has no more samples.
#[derive(Debug)]
pub(crate) struct Exhausted;

impl<T: Send + 'static> Prefetcher<T> {
    /// Starts the background thread. It loads the single samples at `first`, then continues from `state`.
    ///
    /// `prepare` receives the sample and its epoch.
    pub fn start(
        dataset: Arc<dyn Dataset>,
        data: &DataConfig,
        seed: u64,
        first: Vec<LoaderState>,
        state: LoaderState,
        mut prepare: impl FnMut(&Sample, u64) -> Result<T, UnusableSample> + Send + 'static,
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
        // A separate pool, so that training and preparation do not wait for each other's tasks.
        let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().map_err(std::io::Error::other)?;
        let work = move || {
            let mut send = |at: LoaderState, sample: Result<Sample, LoadError>, next| {
                let unreadable =
                    |error: LoadError| SkippedSample { sample: error.scene_id, error: error.source.to_string() };
                let example = sample.map_err(unreadable).and_then(|sample| {
                    pool.install(|| prepare(&sample, at.epoch))
                        .map_err(|error| SkippedSample { sample: sample.id, error: error.to_string() })
                });
                sender.send(PreparedSample { at, example, next }).is_ok()
            };
            let single = LoaderConfig { threads: 1, prefetch: 1, ..config };
            for at in first {
                let Some(sample) = Loader::resume(dataset.clone(), single, at).next() else { return };
                if !send(at, sample, state) {
                    return;
                }
            }
            let mut loader = Loader::resume(dataset, config, state);
            loop {
                let at = loader.state();
                let Some(sample) = loader.next() else { return };
                if !send(at, sample, loader.state()) {
                    return;
                }
            }
        };
        let thread = std::thread::Builder::new().name("examples".into()).spawn(work)?;
        Ok(Self { receiver: Some(receiver), thread: Some(thread), waited: Duration::ZERO })
    }

    /// Waits for the next sample. Propagates a panic of the background thread.
    pub fn next(&mut self) -> Result<PreparedSample<T>, Exhausted> {
        let begun = Instant::now();
        let received = self.receiver.as_ref().ok_or(Exhausted)?.recv();
        self.waited += begun.elapsed();
        received.map_err(|_| {
            self.receiver = None;
            if let Some(Err(panic)) = self.thread.take().map(JoinHandle::join) {
                std::panic::resume_unwind(panic);
            }
            Exhausted
        })
    }

    /// Returns and resets the time spent waiting in [`next`](Self::next).
    pub fn take_waited(&mut self) -> Duration {
        std::mem::take(&mut self.waited)
    }
}

impl<T> Drop for Prefetcher<T> {
    fn drop(&mut self) {
        // Without a receiver, the thread's next send fails and it exits.
        self.receiver = None;
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}
