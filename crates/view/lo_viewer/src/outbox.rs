//! Pending messages of each page. Only the newest of each kind is kept, so that a slow page does not use up memory.

use std::collections::{BTreeMap, VecDeque};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use tokio::sync::Notify;

use crate::protocol::{Encoded, OPENING_SLOT, RECENT_SLOT, ToPage, encoded};

/// Maximum number of pending messages that newer ones do not replace.
const MAX_QUEUED: usize = 16;

/// Pending messages for one page.
#[derive(Default)]
pub(crate) struct Outbox {
    pending: Mutex<PendingMessages>,
    arrived: Notify,
}

#[derive(Default)]
struct PendingMessages {
    /// Newest message by slot.
    newest: BTreeMap<u8, Arc<Encoded>>,
    /// Messages without a slot, in order.
    queue: VecDeque<Arc<Encoded>>,
}

impl Outbox {
    /// Adds a message, replacing the one of the same slot.
    pub fn put(&self, slot: Option<u8>, message: Arc<Encoded>) {
        let mut pending = self.pending.lock().unwrap_or_else(PoisonError::into_inner);
        match slot {
            Some(slot) => drop(pending.newest.insert(slot, message)),
            None => {
                if pending.queue.len() >= MAX_QUEUED {
                    pending.queue.pop_front();
                }
                pending.queue.push_back(message);
            }
        }
        drop(pending);
        self.arrived.notify_one();
    }

    /// Waits for the next message.
    pub async fn next(&self) -> Arc<Encoded> {
        loop {
            if let Some(message) = self.take() {
                return message;
            }
            self.arrived.notified().await;
        }
    }

    fn take(&self) -> Option<Arc<Encoded>> {
        let mut pending = self.pending.lock().unwrap_or_else(PoisonError::into_inner);
        let first = pending.newest.pop_first().map(|(_, message)| message);
        first.or_else(|| pending.queue.pop_front())
    }
}

/// All open pages, and the messages that a new one receives first.
#[derive(Default)]
pub(crate) struct Pages {
    open: Mutex<OpenPages>,
}

#[derive(Default)]
struct OpenPages {
    outboxes: Vec<Arc<Outbox>>,
    /// Last messages of scene, state and image by slot, for pages that join later.
    replayed: BTreeMap<u8, Arc<Encoded>>,
}

impl Pages {
    fn lock(&self) -> MutexGuard<'_, OpenPages> {
        self.open.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Adds a page; `None` if `limit` pages are open. Its outbox starts with `hello` and the current scene, state and
    /// image.
    pub fn join(&self, hello: &ToPage, limit: usize) -> Option<Arc<Outbox>> {
        let outbox = Arc::new(Outbox::default());
        send(&outbox, hello, &[]);
        let mut open = self.lock();
        if open.outboxes.len() >= limit {
            return None;
        }
        open.replayed.iter().for_each(|(&slot, message)| outbox.put(Some(slot), message.clone()));
        open.outboxes.push(outbox.clone());
        Some(outbox)
    }

    /// Removes a page.
    pub fn leave(&self, outbox: &Arc<Outbox>) {
        self.lock().outboxes.retain(|other| !Arc::ptr_eq(other, outbox));
    }

    /// Sends a message to all pages.
    pub fn send(&self, message: &ToPage, images: &[&[u8]]) {
        let (slot, encoded) = (message.slot(), Arc::new(encoded(message, images)));
        let mut open = self.lock();
        match (message, slot) {
            // Another scene, or none: messages of the previous one are obsolete.
            (ToPage::Empty { .. } | ToPage::Scene(_), Some(slot)) => {
                open.replayed.retain(|&other, _| matches!(other, RECENT_SLOT | OPENING_SLOT));
                open.replayed.insert(slot, encoded.clone());
            }
            (ToPage::OpeningEnded, Some(slot)) => drop(open.replayed.remove(&slot)),
            (
                ToPage::Recent { .. }
                | ToPage::Opening { .. }
                | ToPage::State { .. }
                | ToPage::Notes { .. }
                | ToPage::Photo { .. }
                | ToPage::Frame { .. },
                Some(slot),
            ) => {
                open.replayed.insert(slot, encoded.clone());
            }
            _ => {}
        }
        open.outboxes.iter().for_each(|outbox| outbox.put(slot, encoded.clone()));
    }
}

/// Sends a message to one page.
pub(crate) fn send(outbox: &Outbox, message: &ToPage, images: &[&[u8]]) {
    outbox.put(message.slot(), Arc::new(encoded(message, images)));
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn a_page_that_does_not_read_holds_the_newest_alone() {
        let pages = Pages::default();
        let (materials, samples) = (Vec::new(), Vec::new());
        let hello = ToPage::Hello { version: "", materials, can_estimate: true, autosaves: false, samples };
        let join = |limit| pages.join(&hello, limit).unwrap();
        let outbox = join(1);
        assert!(pages.join(&hello, 1).is_none());
        let image = vec![0; 1 << 20];
        for change in 0..1000 {
            let frame = ToPage::Frame {
                change,
                sequence: 0,
                step: lo_session::RenderStep::Moving,
                mime: "image/jpeg",
                at: None,
                lengths: [image.len()],
                took_ms: 0.0,
            };
            pages.send(&frame, &[&image]);
            pages.send(&ToPage::Refused { why: change.to_string() }, &[]);
        }
        let mut held = Vec::new();
        while let Some(message) = outbox.take() {
            held.push(message);
        }
        let text = |message: &Encoded| match message {
            Encoded::Text(text) => text.clone(),
            Encoded::Binary(bytes) => String::from_utf8_lossy(&bytes[4..60]).into_owned(),
        };
        assert_eq!(held.len(), 2 + MAX_QUEUED);
        assert!(text(&held[0]).contains("hello"));
        assert!(text(&held[1]).contains("\"change\":999"), "{}", text(&held[1]));
        assert!(text(&held[1 + MAX_QUEUED]).contains("999"));
        // A page that joins later receives the current image, until there is none.
        let late = join(2);
        assert!(late.take().is_some_and(|message| text(&message).contains("hello")));
        assert!(late.take().is_some_and(|message| text(&message).contains("\"change\":999")));
        assert!(late.take().is_none());
        pages.send(&ToPage::Empty { error: None }, &[]);
        let latest = join(3);
        assert_eq!(std::iter::from_fn(|| latest.take()).count(), 2);
        // While another scene is being opened, a page receives this, too; not any more after the end.
        pages.send(&ToPage::Opening { file: "a".into(), stage: String::new(), done: None }, &[]);
        let during = join(4);
        assert_eq!(std::iter::from_fn(|| during.take()).count(), 3);
        pages.send(&ToPage::OpeningEnded, &[]);
        pages.leave(&during);
        let after = join(4);
        assert_eq!(std::iter::from_fn(|| after.take()).count(), 2);
        pages.leave(&after);
        [outbox, late, latest].iter().for_each(|outbox| pages.leave(outbox));
        assert!(pages.lock().outboxes.is_empty());
    }
}
