//! Requests for images of the room from outside: one per page, the newest.

use std::collections::VecDeque;
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::Instant;

use lo_imaging as imaging;
use lo_session::{LitSceneCache, OutsideRenderer, OutsideView, State};

use crate::failure::guarded;
use crate::outbox::{Outbox, send};
use crate::protocol::{DRAFT_JPEG_QUALITY, ToPage};

/// A page's request for an image.
pub(crate) struct OutsideRequest {
    pub outbox: Arc<Outbox>,
    pub sequence: u64,
    pub view: OutsideView,
    pub state: Arc<State>,
}

/// Pending requests of all pages, at most one per page, oldest first.
#[derive(Default)]
pub(crate) struct OutsideQueue {
    pending: Mutex<PendingRequests>,
    changed: Condvar,
}

#[derive(Default)]
struct PendingRequests {
    requests: VecDeque<OutsideRequest>,
    is_over: bool,
}

impl OutsideQueue {
    fn lock(&self) -> MutexGuard<'_, PendingRequests> {
        self.pending.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Enqueues a request, replacing a pending one of the same page.
    pub fn request(&self, request: OutsideRequest) {
        let mut pending = self.lock();
        match pending.requests.iter_mut().find(|other| Arc::ptr_eq(&other.outbox, &request.outbox)) {
            Some(last) => *last = request,
            None => pending.requests.push_back(request),
        }
        self.changed.notify_all();
    }

    /// Ends [`OutsideQueue::serve`].
    pub fn end(&self) {
        self.lock().is_over = true;
        self.changed.notify_all();
    }

    fn next(&self) -> Option<OutsideRequest> {
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

    fn is_superseded(&self, outbox: &Arc<Outbox>) -> bool {
        let pending = self.lock();
        pending.is_over || pending.requests.iter().any(|other| Arc::ptr_eq(&other.outbox, outbox))
    }

    /// Renders requests until [`OutsideQueue::end`].
    pub fn serve(&self, scenes: &Arc<LitSceneCache>) {
        let mut outside = OutsideRenderer::new(scenes.clone());
        while let Some(OutsideRequest { outbox, sequence, view, state }) = self.next() {
            let begun = Instant::now();
            let why = match guarded(|| outside.render(&state, &view, &|| self.is_superseded(&outbox))) {
                Ok(None) => continue,
                Ok(Some(image)) => {
                    let (mime, name) =
                        if view.still { ("image/png", "outside.png") } else { ("image/jpeg", "outside.jpg") };
                    match imaging::encode_srgb8(name, &image, DRAFT_JPEG_QUALITY, "lightoctree view") {
                        Ok(bytes) => {
                            let took_ms = 1e3 * begun.elapsed().as_secs_f64();
                            let message = ToPage::Outside { sequence, mime, lengths: [bytes.len()], took_ms };
                            send(&outbox, &message, &[&bytes]);
                            continue;
                        }
                        Err(error) => error.to_string(),
                    }
                }
                Err(error) => error.to_string(),
            };
            send(&outbox, &ToPage::Refused { why }, &[]);
        }
    }
}
