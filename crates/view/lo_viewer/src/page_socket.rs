//! The WebSocket of one page: relays messages, and drops a page that no longer answers.

use std::time::Duration;

use axum::body::Bytes;
use axum::extract::ws::{CloseFrame, Message, WebSocket};
use tokio::time::{Instant, interval, sleep_until, timeout};

use crate::app::App;
use crate::outbox::send;
use crate::protocol::{Encoded, FromPage, ToPage};

/// Maximum number of open pages.
pub(crate) const MAX_PAGES: usize = 16;

/// Close code and reason for pages beyond [`MAX_PAGES`]. The page shows the reason.
const TOO_MANY_PAGES: (u16, &str) = (4001, "too many pages are open");

/// Interval of pings, which browsers answer by themselves.
const PING_INTERVAL: Duration = Duration::from_secs(2);

/// Time without any message or answer after which a page is dropped.
const SILENCE: Duration = Duration::from_secs(8);

/// Slowest connection, bytes per second. An answer may be delayed by messages that are still being transferred.
const MIN_BYTES_PER_S: f64 = 1e5;

/// Time in which a refused page has to close its connection.
const CLOSING_TIME: Duration = Duration::from_secs(2);

/// Relays messages between one page and the session, until the page is closed or silent.
pub(crate) async fn serve(app: App, mut socket: WebSocket) {
    let Some(outbox) = app.session.join(MAX_PAGES) else {
        refuse(socket).await;
        return;
    };
    let mut deadline = Deadline::new();
    let mut ping = interval(PING_INTERVAL);
    loop {
        let sent = tokio::select! {
            biased;
            received = socket.recv() => {
                deadline = Deadline::new();
                match received {
                    Some(Ok(Message::Text(text))) => match serde_json::from_str::<FromPage>(&text) {
                        Ok(message) => app.session.receive(message, &outbox).await,
                        Err(error) => {
                            send(&outbox, &ToPage::Refused { why: format!("invalid message: {error}") }, &[]);
                        }
                    },
                    Some(Ok(Message::Binary(_))) => {
                        send(&outbox, &ToPage::Refused { why: "invalid message: messages must be text".into() }, &[]);
                    }
                    Some(Ok(Message::Ping(_) | Message::Pong(_))) => {}
                    Some(Ok(Message::Close(_)) | Err(_)) | None => break,
                }
                continue;
            }
            () = sleep_until(deadline.at()) => break,
            _ = ping.tick() => Message::Ping(Bytes::new()),
            message = outbox.next() => match &*message {
                Encoded::Text(text) => Message::Text(text.clone().into()),
                Encoded::Binary(bytes) => Message::Binary(bytes.clone().into()),
            },
        };
        deadline.add(match &sent {
            Message::Binary(bytes) => bytes.len(),
            Message::Text(text) => text.len(),
            _ => 0,
        });
        match tokio::time::timeout_at(deadline.at(), socket.send(sent)).await {
            Ok(Ok(())) => {}
            Ok(Err(_)) | Err(_) => break,
        }
    }
    app.session.pages.leave(&outbox);
}

async fn refuse(mut socket: WebSocket) {
    let (code, reason) = TOO_MANY_PAGES;
    let close = Message::Close(Some(CloseFrame { code, reason: reason.into() }));
    let closed = async {
        let is_sent = socket.send(close).await.is_ok();
        // Closing the connection at once could discard the frame.
        while is_sent && matches!(socket.recv().await, Some(Ok(_))) {}
    };
    let _ = timeout(CLOSING_TIME, closed).await;
}

/// Time at which a page without an answer is dropped.
struct Deadline {
    heard: Instant,
    /// Bytes sent since then.
    sent: usize,
}

impl Deadline {
    fn new() -> Self {
        Self { heard: Instant::now(), sent: 0 }
    }

    fn add(&mut self, bytes: usize) {
        self.sent += bytes;
    }

    fn at(&self) -> Instant {
        self.heard + SILENCE + Duration::from_secs_f64(self.sent as f64 / MIN_BYTES_PER_S)
    }
}
