//! Requests of pages, of which each page has at most one: its newest.

use std::collections::VecDeque;
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};

use crate::outbox::Outbox;

/// Pending requests of all pages, oldest first. A request replaces the pending one of the same page.
pub(crate) struct PageQueue<T> {
    pending: Mutex<PendingRequests<T>>,
    changed: Condvar,
}

struct PendingRequests<T> {
    requests: VecDeque<(Arc<Outbox>, T)>,
    is_over: bool,
}

impl<T> Default for PageQueue<T> {
    fn default() -> Self {
        let pending = PendingRequests { requests: VecDeque::new(), is_over: false };
        Self { pending: Mutex::new(pending), changed: Condvar::new() }
    }
}

impl<T> PageQueue<T> {
    fn lock(&self) -> MutexGuard<'_, PendingRequests<T>> {
        self.pending.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Enqueues a request.
    pub fn request(&self, outbox: &Arc<Outbox>, request: T) {
        let mut pending = self.lock();
        match pending.requests.iter_mut().find(|(other, _)| Arc::ptr_eq(other, outbox)) {
            Some((_, last)) => *last = request,
            None => pending.requests.push_back((outbox.clone(), request)),
        }
        self.changed.notify_all();
    }

    /// Ends the queue.
    pub fn end(&self) {
        self.lock().is_over = true;
        self.changed.notify_all();
    }

    /// Waits for the next request; `None` after [`PageQueue::end`].
    pub fn next(&self) -> Option<(Arc<Outbox>, T)> {
        let mut pending = self.lock();
        loop {
            if pending.is_over {
                return None;
            }
            if let Some(request) = pending.requests.pop_front() {
                return Some(request);
            }
            pending = self.changed.wait(pending).unwrap_or_else(PoisonError::into_inner);
        }
    }

    /// Returns whether a page has sent another request, or the queue has ended.
    pub fn is_superseded(&self, outbox: &Arc<Outbox>) -> bool {
        let pending = self.lock();
        pending.is_over || pending.requests.iter().any(|(other, _)| Arc::ptr_eq(other, outbox))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_page_has_one_request_the_newest() {
        let queue = PageQueue::default();
        let pages = [Arc::new(Outbox::default()), Arc::new(Outbox::default())];
        for number in 0..1000 {
            queue.request(&pages[number % 2], number);
        }
        assert!(queue.is_superseded(&pages[0]));
        assert_eq!(queue.next().map(|(_, number)| number), Some(998));
        assert!(!queue.is_superseded(&pages[0]) && queue.is_superseded(&pages[1]));
        assert_eq!(queue.next().map(|(_, number)| number), Some(999));
        queue.request(&pages[0], 1);
        queue.end();
        assert!(queue.next().is_none() && queue.is_superseded(&pages[0]));
    }
}
