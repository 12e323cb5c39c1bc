use std::any::Any;
use std::collections::BTreeMap;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;

use crate::loading::{LoadError, LoaderConfig, LoaderState};
use crate::order::Permutation;
use crate::{Dataset, Sample};

/// Threads that make the blocks of a dataset ahead of the one who takes them. Dropping it stops them after the block at hand.
pub(crate) struct Prefetch {
    shared: Arc<Shared>,
    threads: Vec<JoinHandle<()>>,
}

/// A sample, and how many of its block come before the next.
pub(crate) struct Made {
    pub number: u64,
    pub result: Result<Sample, LoadError>,
}

impl Prefetch {
    /// Begins with the block where `first` stands.
    pub(crate) fn start(dataset: Arc<dyn Dataset>, config: LoaderConfig, first: LoaderState) -> Self {
        let blocks = (dataset.len() as u64).div_ceil(dataset.block().max(1) as u64);
        let shared = Arc::new(Shared {
            dataset,
            config,
            blocks,
            first,
            queue: Mutex::default(),
            finished: Condvar::new(),
            room: Condvar::new(),
        });
        let threads = (0..config.threads.max(1))
            .map(|_| {
                let shared = Arc::clone(&shared);
                std::thread::spawn(move || shared.work())
            })
            .collect();
        Self { shared, threads }
    }

    /// Blocks of an epoch.
    pub(crate) fn blocks(&self) -> u64 {
        self.shared.blocks
    }

    /// Waits for the next block; a panic of the dataset goes on here. Must not be called more often than there are blocks.
    pub(crate) fn next(&self) -> Vec<Made> {
        let mut queue = self.shared.lock();
        loop {
            let ticket = queue.next_given;
            if let Some(block) = queue.finished.remove(&ticket) {
                queue.next_given += 1;
                drop(queue);
                self.shared.room.notify_all();
                return block.unwrap_or_else(|panic| resume_unwind(panic));
            }
            queue = self.shared.finished.wait(queue).unwrap_or_else(PoisonError::into_inner);
        }
    }
}

impl Drop for Prefetch {
    fn drop(&mut self) {
        self.shared.lock().stop = true;
        self.shared.room.notify_all();
        for thread in self.threads.drain(..) {
            // a panic of the dataset was caught inside; there is nothing to hear from the thread itself
            let _ = thread.join();
        }
    }
}

struct Shared {
    dataset: Arc<dyn Dataset>,
    config: LoaderConfig,
    blocks: u64,
    first: LoaderState,
    queue: Mutex<Queue>,
    /// A block was finished, or the threads have to stop.
    finished: Condvar,
    /// There is room for another block, or the threads have to stop.
    room: Condvar,
}

/// Blocks are counted by tickets from the loader's start.
#[derive(Default)]
struct Queue {
    next_taken: u64,
    next_given: u64,
    finished: BTreeMap<u64, Result<Vec<Made>, Box<dyn Any + Send>>>,
    stop: bool,
}

impl Shared {
    /// The queue is whole even where a thread panicked with it in its hand: no panic can happen between two of its changes.
    fn lock(&self) -> MutexGuard<'_, Queue> {
        self.queue.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn work(&self) {
        let ahead = self.config.prefetch.max(self.config.threads) as u64;
        let mut order: Option<(u64, Permutation)> = None;
        loop {
            let ticket = {
                let mut queue = self.lock();
                while !queue.stop && queue.next_taken >= queue.next_given + ahead {
                    queue = self.room.wait(queue).unwrap_or_else(PoisonError::into_inner);
                }
                if queue.stop {
                    return;
                }
                queue.next_taken += 1;
                queue.next_taken - 1
            };
            let Some((epoch, position)) = self.place(ticket) else { return };
            let block = if self.config.shuffle {
                if order.as_ref().is_none_or(|(of, _)| *of != epoch) {
                    order = Some((epoch, Permutation::new(self.blocks, self.config.seed, epoch)));
                }
                order.as_ref().map_or(position, |(_, permutation)| permutation.at(position))
            } else {
                position
            };
            let made = catch_unwind(AssertUnwindSafe(|| self.make(block)));
            self.lock().finished.insert(ticket, made);
            self.finished.notify_all();
        }
    }

    /// Epoch and position in it of a ticket; `None` beyond the last epoch.
    fn place(&self, ticket: u64) -> Option<(u64, u64)> {
        let from_start = (self.first.block.min(self.blocks)).checked_add(ticket)?;
        let epoch = self.first.epoch.checked_add(from_start.checked_div(self.blocks)?)?;
        let inside = self.config.epochs.is_none_or(|epochs| epoch < epochs);
        inside.then_some((epoch, from_start % self.blocks))
    }

    fn make(&self, block: u64) -> Vec<Made> {
        let size = self.dataset.block().max(1);
        let first = block as usize * size;
        let indices = first..(first + size).min(self.dataset.len());
        let wanted = |index: &usize| self.config.split.is_none_or(|split| self.dataset.split(*index) == split);
        indices
            .filter(wanted)
            .map(|index| Made {
                number: (index - first) as u64,
                result: self.dataset.get(index).map_err(|source| LoadError {
                    index,
                    scene_id: self.dataset.scene_id(index).into_owned(),
                    source,
                }),
            })
            .collect()
    }
}
