//! Examples made ahead by a thread of their own.

use std::sync::Arc;
use std::sync::mpsc::{Receiver, sync_channel};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use dataset::{Dataset, Loader, LoaderConfig, LoaderState, Sample, Split};

use crate::config::DataConfig;

/// What a sample became, and where the loader stands after it.
pub(crate) struct Fed<T> {
    pub example: Result<T, String>,
    pub next: LoaderState,
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
    /// Begins where a loader stands. `prepare` is given the epoch too.
    pub fn start(
        dataset: Arc<dyn Dataset>,
        data: &DataConfig,
        seed: u64,
        state: LoaderState,
        mut prepare: impl FnMut(&Sample, u64) -> Result<T, String> + Send + 'static,
    ) -> std::io::Result<Self> {
        let config = LoaderConfig {
            seed,
            shuffle: true,
            split: Some(Split::Train),
            epochs: None,
            threads: data.threads,
            ahead: data.ahead,
        };
        let (sender, receiver) = sync_channel(data.ahead);
        // A pool of its own: the trainer's threads must not wait for what is prepared, nor the other way round.
        let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().map_err(std::io::Error::other)?;
        let work = move || {
            let mut loader = Loader::resume(dataset, config, state);
            loop {
                let epoch = loader.state().epoch;
                let Some(sample) = loader.next() else { return };
                let example = sample.map_err(|error| error.to_string()).and_then(|sample| {
                    let id = sample.id.clone();
                    pool.install(|| prepare(&sample, epoch)).map_err(|error| format!("{id}: {error}"))
                });
                if sender.send(Fed { example, next: loader.state() }).is_err() {
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

impl<T> Drop for Feed<T> {
    fn drop(&mut self) {
        // Its next attempt to send ends the thread.
        self.receiver = None;
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}
