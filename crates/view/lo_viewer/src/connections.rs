//! Accepts connections. Limits their number, and closes those that do not send a request or do not take a response.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use axum::{Extension, Router};
use hyper::server::conn::http1;
use hyper_util::rt::{TokioIo, TokioTimer};
use hyper_util::service::TowerToHyperService;
use tokio::net::{TcpListener, TcpStream};
use tokio::task::AbortHandle;

use crate::stall_guard::StallGuard;

/// Maximum number of connections.
const MAX_CONNECTIONS: usize = 128;

/// Time in which a connection has to send the head of its next request.
pub(crate) const HEADER_TIMEOUT: Duration = Duration::from_secs(10);

/// Longest head of a request, bytes.
const MAX_HEADER_BYTES: usize = 64 << 10;

/// Pause after a connection could not be accepted, usually for lack of file descriptors.
const ACCEPT_PAUSE: Duration = Duration::from_millis(50);

/// Whether a connection has sent a request with the token. Requests have it as an extension.
#[derive(Clone, Default)]
pub(crate) struct Trusted(Arc<AtomicBool>);

impl Trusted {
    /// Marks the connection.
    pub fn set(&self) {
        self.0.store(true, Ordering::Relaxed);
    }

    fn get(&self) -> bool {
        self.0.load(Ordering::Relaxed)
    }
}

/// An open connection.
struct Connection {
    trusted: Trusted,
    task: AbortHandle,
}

/// Serves connections until the future is dropped.
pub(crate) async fn serve(listener: TcpListener, router: Router) {
    let mut open: Vec<Connection> = Vec::new();
    loop {
        let Ok((stream, _)) = listener.accept().await else {
            tokio::time::sleep(ACCEPT_PAUSE).await;
            continue;
        };
        open.retain(|connection| !connection.task.is_finished());
        if open.len() >= MAX_CONNECTIONS {
            // Whoever has no token makes way for newer connections.
            match open.iter().position(|connection| !connection.trusted.get()) {
                Some(stranger) => open.remove(stranger).task.abort(),
                None => continue,
            }
        }
        let trusted = Trusted::default();
        let task = tokio::spawn(serve_connection(stream, router.clone().layer(Extension(trusted.clone()))));
        open.push(Connection { trusted, task: task.abort_handle() });
    }
}

async fn serve_connection(stream: TcpStream, router: Router) {
    let connection = http1::Builder::new()
        .timer(TokioTimer::new())
        .header_read_timeout(HEADER_TIMEOUT)
        .max_buf_size(MAX_HEADER_BYTES)
        .serve_connection(TokioIo::new(StallGuard::new(stream)), TowerToHyperService::new(router))
        .with_upgrades();
    // Errors are those of the other end.
    let _ = connection.await;
}
