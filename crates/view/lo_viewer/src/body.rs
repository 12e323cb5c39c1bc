//! Reading of request bodies with limits on size and time.

use std::future::poll_fn;
use std::pin::Pin;
use std::sync::Arc;
use std::time::Duration;

use axum::body::Body;
use axum::http::StatusCode;
use futures_core::Stream;
use tokio::time::{Instant, timeout_at};

use crate::uploads::{Reservation, Uploads};

/// Time in which the next part of a body has to arrive.
const PART_TIMEOUT: Duration = Duration::from_secs(20);

/// Slowest mean rate after that time, bytes per second.
const MIN_BYTES_PER_S: f64 = 1e4;

/// Reads a whole body of at most `max_bytes`. Returns it with its reservation, or status and reason of a refusal.
pub(crate) async fn read_body(
    body: Body,
    uploads: &Arc<Uploads>,
    max_bytes: usize,
) -> Result<(Vec<u8>, Reservation), (StatusCode, String)> {
    let mut parts = body.into_data_stream();
    let (mut bytes, mut reservation) = (Vec::new(), uploads.reserve());
    let begun = Instant::now();
    loop {
        let slowest = begun + PART_TIMEOUT + Duration::from_secs_f64(bytes.len() as f64 / MIN_BYTES_PER_S);
        let deadline = slowest.min(Instant::now() + PART_TIMEOUT);
        let part = match timeout_at(deadline, poll_fn(|context| Pin::new(&mut parts).poll_next(context))).await {
            Ok(Some(Ok(part))) => part,
            Ok(Some(Err(error))) => return Err((StatusCode::BAD_REQUEST, error.to_string())),
            Ok(None) => return Ok((bytes, reservation)),
            Err(_) => return Err((StatusCode::REQUEST_TIMEOUT, "the upload takes too long".to_owned())),
        };
        if bytes.len() + part.len() > max_bytes {
            let why = format!("too large: at most {} MB are accepted", max_bytes >> 20);
            return Err((StatusCode::PAYLOAD_TOO_LARGE, why));
        }
        reservation.add(part.len()).map_err(|error| (StatusCode::PAYLOAD_TOO_LARGE, error.to_string()))?;
        bytes.extend_from_slice(&part);
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use std::collections::VecDeque;
    use std::task::{Context, Poll};

    use axum::body::Bytes;
    use tokio::time::{Sleep, sleep};

    use super::*;

    const MAX_BYTES: usize = 4 << 20;

    /// Parts of a body, each after a pause.
    struct Parts(VecDeque<(Duration, usize)>, Option<Pin<Box<Sleep>>>);

    impl Stream for Parts {
        type Item = Result<Bytes, std::io::Error>;

        fn poll_next(mut self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<Option<Self::Item>> {
            let Some(&(pause, bytes)) = self.0.front() else { return Poll::Ready(None) };
            let pause = self.1.get_or_insert_with(|| Box::pin(sleep(pause)));
            if pause.as_mut().poll(context).is_pending() {
                return Poll::Pending;
            }
            (self.1, _) = (None, self.0.pop_front());
            Poll::Ready(Some(Ok(Bytes::from(vec![0; bytes]))))
        }
    }

    fn read(parts: impl IntoIterator<Item = (u64, usize)>) -> Result<usize, StatusCode> {
        let parts = parts.into_iter().map(|(pause_s, bytes)| (Duration::from_secs(pause_s), bytes)).collect();
        // The clock of the test jumps to the next timer.
        let runtime = tokio::runtime::Builder::new_current_thread().enable_time().start_paused(true).build().unwrap();
        let body = Body::from_stream(Parts(parts, None));
        let read = runtime.block_on(read_body(body, &Arc::default(), MAX_BYTES));
        read.map(|(bytes, _)| bytes.len()).map_err(|(status, _)| status)
    }

    #[test]
    fn slow_and_long_bodies_are_refused() {
        assert_eq!(read([(0, 3), (19, 5)]), Ok(8));
        assert_eq!(read([]), Ok(0));
        assert_eq!(read([(21, 8)]), Err(StatusCode::REQUEST_TIMEOUT));
        // 20 kB/s for three minutes, and a byte every 15 seconds.
        assert_eq!(read([(15, 300_000); 12]), Ok(3_600_000));
        assert_eq!(read([(15, 1); 12]), Err(StatusCode::REQUEST_TIMEOUT));
        assert_eq!(read([(0, MAX_BYTES / 2); 2]), Ok(MAX_BYTES));
        assert_eq!(read([(0, MAX_BYTES), (0, 1)]), Err(StatusCode::PAYLOAD_TOO_LARGE));
    }
}
