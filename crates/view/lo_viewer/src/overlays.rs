//! Makes overlays for pages. Each is made once for a scene.

use std::sync::Arc;

use lo_session::{OpenScene, Overlay, overlay};

use crate::failure::guarded;
use crate::outbox::send;
use crate::page_queue::PageQueue;
use crate::protocol::{Encoded, OVERLAY_SLOT, ToPage, encoded};

/// Sends requested overlays until the queue ends.
pub(crate) fn serve(queue: &PageQueue<Overlay>, scene: &OpenScene) {
    let mut made: Vec<(Overlay, Arc<Encoded>)> = Vec::new();
    while let Some((outbox, what)) = queue.next() {
        if let Some((_, message)) = made.iter().find(|(other, _)| *other == what) {
            outbox.put(Some(OVERLAY_SLOT), message.clone());
            continue;
        }
        match message(scene, what) {
            Ok(message) => {
                made.push((what, message.clone()));
                outbox.put(Some(OVERLAY_SLOT), message);
            }
            Err(why) => send(&outbox, &ToPage::Refused { why }, &[]),
        }
    }
}

fn message(scene: &OpenScene, what: Overlay) -> Result<Arc<Encoded>, String> {
    let overlay = guarded(|| overlay(scene, what)).map_err(|failure| failure.to_string())?;
    let css = |[r, g, b]: [u8; 3]| format!("rgb({r} {g} {b})");
    let legend = overlay.legend.into_iter().map(|(color, text)| (css(color), text)).collect();
    let png = lo_imaging::encode_rgba8("overlay.png", &overlay.image, "lightoctree view");
    let png = png.map_err(|error| error.to_string())?;
    Ok(Arc::new(encoded(&ToPage::Overlay { what, legend, lengths: [png.len()] }, &[&png])))
}
