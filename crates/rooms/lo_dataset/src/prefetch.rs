use std::any::Any;
use std::collections::BTreeMap;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;

/// Threads that make numbered items ahead of the consumer, which takes them in order. Dropping it stops them after
/// their current items.
pub(crate) struct Prefetch<T> {
    shared: Arc<Shared<T>>,
    threads: Vec<JoinHandle<()>>,
}

impl<T: Send + 'static> Prefetch<T> {
    /// Starts the threads. `make` is called with numbers from 0 on; `None` means the end. At most `ahead` items are
    /// begun before they are taken.
    pub(crate) fn start(threads: usize, ahead: usize, make: impl Fn(u64) -> Option<T> + Send + Sync + 'static) -> Self {
        let shared = Arc::new(Shared {
            make: Box::new(make),
            ahead: ahead.max(threads).max(1) as u64,
            queue: Mutex::default(),
            finished: Condvar::new(),
            room: Condvar::new(),
        });
        let threads = (0..threads.max(1))
            .map(|_| {
                let shared = Arc::clone(&shared);
                std::thread::spawn(move || shared.work())
            })
            .collect();
        Self { shared, threads }
    }

    /// Waits for the next item. A panic of `make` is propagated. Must not be called more often than there are items.
    pub(crate) fn next(&self) -> T {
        let mut queue = self.shared.lock();
        loop {
            let number = queue.next_given;
            if let Some(made) = queue.finished.remove(&number) {
                queue.next_given += 1;
                drop(queue);
                self.shared.room.notify_all();
                return made.unwrap_or_else(|panic| resume_unwind(panic));
            }
            queue = self.shared.finished.wait(queue).unwrap_or_else(PoisonError::into_inner);
        }
    }
}

impl<T> Drop for Prefetch<T> {
    fn drop(&mut self) {
        self.shared.lock().stop = true;
        self.shared.room.notify_all();
        for thread in self.threads.drain(..) {
            // Panics of `make` are caught inside the thread, so there is nothing to propagate here.
            let _ = thread.join();
        }
    }
}

struct Shared<T> {
    make: Box<dyn Fn(u64) -> Option<T> + Send + Sync>,
    ahead: u64,
    queue: Mutex<Queue<T>>,
    /// Signals that an item was finished or the threads have to stop.
    finished: Condvar,
    /// Signals that there is room for another item or the threads have to stop.
    room: Condvar,
}

struct Queue<T> {
    next_taken: u64,
    next_given: u64,
    finished: BTreeMap<u64, Result<T, Box<dyn Any + Send>>>,
    stop: bool,
}

impl<T> Default for Queue<T> {
    fn default() -> Self {
        Self { next_taken: 0, next_given: 0, finished: BTreeMap::new(), stop: false }
    }
}

impl<T> Shared<T> {
    /// Locks the queue. It stays consistent even if a thread panicked while holding the lock: no panic can happen
    /// between two of its changes.
    fn lock(&self) -> MutexGuard<'_, Queue<T>> {
        self.queue.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn work(&self) {
        loop {
            let number = {
                let mut queue = self.lock();
                while !queue.stop && queue.next_taken >= queue.next_given + self.ahead {
                    queue = self.room.wait(queue).unwrap_or_else(PoisonError::into_inner);
                }
                if queue.stop {
                    return;
                }
                queue.next_taken += 1;
                queue.next_taken - 1
            };
            let made = match catch_unwind(AssertUnwindSafe(|| (self.make)(number))) {
                Ok(Some(made)) => Ok(made),
                Ok(None) => return,
                Err(panic) => Err(panic),
            };
            self.lock().finished.insert(number, made);
            self.finished.notify_all();
        }
    }
}
