//! Who looks at the room from outside: each page from its own place, the newest one.

use std::collections::VecDeque;
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::Instant;

use lightoctree::imaging;
use lo_session::{LitScenes, Outside, OutsideView, State};

use crate::failure::guarded;
use crate::outbox::{Outbox, tell};
use crate::protocol::{MOVING_QUALITY, ToPage};

/// What a page asks for.
pub(crate) struct OutsideRequest {
    pub outbox: Arc<Outbox>,
    pub sequence: u64,
    pub view: OutsideView,
    pub state: Arc<State>,
}

/// What the pages wait for, one picture each, whoever has waited longest first.
#[derive(Default)]
pub(crate) struct OutsideQueue {
    waiting: Mutex<Waiting>,
    changed: Condvar,
}

#[derive(Default)]
struct Waiting {
    looks: VecDeque<OutsideRequest>,
    is_over: bool,
}

impl OutsideQueue {
    fn lock(&self) -> MutexGuard<'_, Waiting> {
        self.waiting.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Asks for a picture; it takes the place of the last one that the page asked for.
    pub fn ask(&self, look: OutsideRequest) {
        let mut waiting = self.lock();
        match waiting.looks.iter_mut().find(|other| Arc::ptr_eq(&other.outbox, &look.outbox)) {
            Some(last) => *last = look,
            None => waiting.looks.push_back(look),
        }
        self.changed.notify_all();
    }

    /// Ends [`OutsideQueue::serve`].
    pub fn end(&self) {
        self.lock().is_over = true;
        self.changed.notify_all();
    }

    fn next(&self) -> Option<OutsideRequest> {
        let mut waiting = self.lock();
        loop {
            if waiting.is_over {
                return None;
            }
            if let Some(look) = waiting.looks.pop_front() {
                return Some(look);
            }
            waiting = self.changed.wait(waiting).unwrap_or_else(PoisonError::into_inner);
        }
    }

    fn is_passed(&self, outbox: &Arc<Outbox>) -> bool {
        let waiting = self.lock();
        waiting.is_over || waiting.looks.iter().any(|other| Arc::ptr_eq(&other.outbox, outbox))
    }

    /// Draws what the pages ask for, until the end.
    pub fn serve(&self, scenes: &Arc<LitScenes>) {
        let mut outside = Outside::new(scenes.clone());
        while let Some(OutsideRequest { outbox, sequence, view, state }) = self.next() {
            let begun = Instant::now();
            let why = match guarded(|| outside.picture(&state, &view, &|| self.is_passed(&outbox))) {
                Ok(None) => continue,
                Ok(Some(image)) => {
                    let (mime, name) =
                        if view.still { ("image/png", "outside.png") } else { ("image/jpeg", "outside.jpg") };
                    match imaging::encode_srgb8(name, &image, MOVING_QUALITY, "lightoctree view") {
                        Ok(bytes) => {
                            let took_ms = 1e3 * begun.elapsed().as_secs_f64();
                            let message = ToPage::Outside { sequence, mime, lengths: [bytes.len()], took_ms };
                            tell(&outbox, &message, &[&bytes]);
                            continue;
                        }
                        Err(error) => error.to_string(),
                    }
                }
                Err(error) => error.to_string(),
            };
            tell(&outbox, &ToPage::Refused { why }, &[]);
        }
    }
}
