//! Renders images of the room from outside for pages.

use std::sync::Arc;
use std::time::Instant;

use lo_imaging as imaging;
use lo_session::{LitSceneCache, OutsideRenderer, OutsideView, State};

use crate::failure::guarded;
use crate::outbox::send;
use crate::page_queue::PageQueue;
use crate::protocol::{DRAFT_JPEG_QUALITY, ToPage};

/// A page's request for an image.
pub(crate) struct OutsideRequest {
    pub sequence: u64,
    pub view: OutsideView,
    pub state: Arc<State>,
}

/// Renders requests until the queue ends.
pub(crate) fn serve(queue: &PageQueue<OutsideRequest>, scenes: &Arc<LitSceneCache>) {
    let mut outside = OutsideRenderer::new(scenes.clone());
    while let Some((outbox, OutsideRequest { sequence, view, state })) = queue.next() {
        let begun = Instant::now();
        let why = match guarded(|| outside.render(&state, &view, &|| queue.is_superseded(&outbox))) {
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
