//! What waits to be sent to one page: of each kind the newest alone, so that a slow page never grows memory.

use std::collections::{BTreeMap, VecDeque};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use tokio::sync::Notify;

use crate::protocol::{Encoded, ToPage, encoded};

/// Most messages of those that are said once.
const MAX_SAID: usize = 16;

/// The messages for one page.
#[derive(Default)]
pub(crate) struct Outbox {
    waiting: Mutex<Waiting>,
    arrived: Notify,
}

#[derive(Default)]
struct Waiting {
    newest: BTreeMap<u8, Arc<Encoded>>,
    said: VecDeque<Arc<Encoded>>,
}

impl Outbox {
    fn put(&self, slot: Option<u8>, message: Arc<Encoded>) {
        let mut waiting = self.waiting.lock().unwrap_or_else(PoisonError::into_inner);
        match slot {
            Some(slot) => drop(waiting.newest.insert(slot, message)),
            None => {
                if waiting.said.len() >= MAX_SAID {
                    waiting.said.pop_front();
                }
                waiting.said.push_back(message);
            }
        }
        drop(waiting);
        self.arrived.notify_one();
    }

    /// The next message, as soon as there is one.
    pub async fn next(&self) -> Arc<Encoded> {
        loop {
            if let Some(message) = self.take() {
                return message;
            }
            self.arrived.notified().await;
        }
    }

    fn take(&self) -> Option<Arc<Encoded>> {
        let mut waiting = self.waiting.lock().unwrap_or_else(PoisonError::into_inner);
        let first = waiting.newest.pop_first().map(|(_, message)| message);
        first.or_else(|| waiting.said.pop_front())
    }
}

/// All pages that are open, and what a new one has to know.
#[derive(Default)]
pub(crate) struct Pages {
    open: Mutex<Open>,
}

#[derive(Default)]
struct Open {
    outboxes: Vec<Arc<Outbox>>,
    /// What all were told of scene, state and picture.
    told: BTreeMap<u8, Arc<Encoded>>,
}

impl Pages {
    fn lock(&self) -> MutexGuard<'_, Open> {
        self.open.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// A new page's, with `hello` and all that the others were told.
    pub fn join(&self, hello: &ToPage) -> Arc<Outbox> {
        let outbox = Arc::new(Outbox::default());
        tell(&outbox, hello, &[]);
        let mut open = self.lock();
        open.told.iter().for_each(|(&slot, message)| outbox.put(Some(slot), message.clone()));
        open.outboxes.push(outbox.clone());
        outbox
    }

    /// A page is gone.
    pub fn leave(&self, outbox: &Arc<Outbox>) {
        self.lock().outboxes.retain(|other| !Arc::ptr_eq(other, outbox));
    }

    /// How many there are.
    pub fn count(&self) -> usize {
        self.lock().outboxes.len()
    }

    /// Tells all of them.
    pub fn tell(&self, message: &ToPage, pictures: &[&[u8]]) {
        let (slot, encoded) = (message.slot(), Arc::new(encoded(message, pictures)));
        let mut open = self.lock();
        match (message, slot) {
            // Another scene, or none: what was told of the last one is over.
            (ToPage::Empty { .. } | ToPage::Opening { .. } | ToPage::Scene(_), Some(slot)) => {
                open.told = BTreeMap::from([(slot, encoded.clone())]);
            }
            (ToPage::State { .. } | ToPage::Notes { .. } | ToPage::Photo { .. } | ToPage::Frame { .. }, Some(slot)) => {
                open.told.insert(slot, encoded.clone());
            }
            _ => {}
        }
        open.outboxes.iter().for_each(|outbox| outbox.put(slot, encoded.clone()));
    }
}

/// Tells one page.
pub(crate) fn tell(outbox: &Outbox, message: &ToPage, pictures: &[&[u8]]) {
    outbox.put(message.slot(), Arc::new(encoded(message, pictures)));
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_page_that_does_not_read_holds_the_newest_alone() {
        let pages = Pages::default();
        let hello = ToPage::Hello { version: "", materials: Vec::new() };
        let outbox = pages.join(&hello);
        let picture = vec![0; 1 << 20];
        for change in 0..1000 {
            let frame = ToPage::Frame {
                change,
                sequence: 0,
                step: lo_session::Step::Moving,
                mime: "image/jpeg",
                at: None,
                lengths: [picture.len()],
                took_ms: 0.0,
            };
            pages.tell(&frame, &[&picture]);
            pages.tell(&ToPage::Refused { why: change.to_string() }, &[]);
        }
        let mut held = Vec::new();
        while let Some(message) = outbox.take() {
            held.push(message);
        }
        let text = |message: &Encoded| match message {
            Encoded::Text(text) => text.clone(),
            Encoded::Binary(bytes) => String::from_utf8_lossy(&bytes[4..60]).into_owned(),
        };
        assert_eq!(held.len(), 2 + MAX_SAID);
        assert!(text(&held[0]).contains("hello"));
        assert!(text(&held[1]).contains("\"change\":999"), "{}", text(&held[1]));
        assert!(text(&held[1 + MAX_SAID]).contains("999"));
        // Who comes later sees the picture at hand, until there is none.
        let late = pages.join(&hello);
        assert!(late.take().is_some_and(|message| text(&message).contains("hello")));
        assert!(late.take().is_some_and(|message| text(&message).contains("\"change\":999")));
        assert!(late.take().is_none());
        pages.tell(&ToPage::Empty { error: None, can_estimate: true }, &[]);
        let latest = pages.join(&hello);
        assert_eq!(std::iter::from_fn(|| latest.take()).count(), 2);
        [outbox, late, latest].iter().for_each(|outbox| pages.leave(outbox));
        assert_eq!(pages.count(), 0);
    }
}
