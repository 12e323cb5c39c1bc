use std::fmt::Write;
use std::net::{IpAddr, Ipv4Addr, Ipv6Addr, SocketAddr};
use std::sync::Arc;
use std::time::Duration;

use axum::Router;
use axum::extract::ws::{Message, WebSocket, WebSocketUpgrade};
use axum::extract::{DefaultBodyLimit, State};
use axum::http::StatusCode;
use axum::middleware::from_fn_with_state;
use axum::response::{IntoResponse, Response};
use axum::routing::{any, get, post};
use tokio::net::TcpListener;

use crate::app::App;
use crate::guard::guard;
use crate::outbox::send;
use crate::pool::MAX_UPLOAD;
use crate::protocol::{Encoded, FromPage, MAX_MESSAGE, ToPage};
use crate::session_actor::SessionHandle;
use crate::{Options, ViewError, download, page, upload};

/// Maximum number of open pages.
const MAX_PAGES: usize = 16;

/// Interval at which `is_over` is polled.
const POLL_INTERVAL: Duration = Duration::from_millis(100);

/// Serves the page until `is_over` returns `true`. Calls `on_ready` with the page's address.
///
/// # Errors
/// If the address cannot be bound, or the system fails to provide threads or random numbers.
pub fn run(
    options: Options,
    on_ready: impl FnOnce(&str),
    is_over: impl Fn() -> bool + Send + 'static,
) -> Result<(), ViewError> {
    let token = match &options.token {
        Some(token) => token.clone(),
        None => random_token()?,
    };
    let session = SessionHandle::start(options.warning_text, options.estimator.is_some())?;
    if let Some(source) = options.source {
        session.open(source);
    }
    let runtime = tokio::runtime::Builder::new_current_thread().enable_io().enable_time().build()?;
    runtime.block_on(async move {
        let failed = |source| ViewError::Bind { address: format!("{}:{}", options.bind, options.port), source };
        let listener = TcpListener::bind((options.bind, options.port)).await.map_err(failed)?;
        let address = listener.local_addr()?;
        let public_origin = options.public_origin.map(Arc::new);
        on_ready(&match &public_origin {
            Some(origin) => format!("{origin}/{token}/"),
            None => format!("http://{}/{token}/", reachable(address)),
        });
        let app =
            App { session, token: token.into(), public_origin, estimator: options.estimator, pool: Arc::default() };
        let ended = async {
            while !is_over() {
                tokio::time::sleep(POLL_INTERVAL).await;
            }
        };
        tokio::select! {
            served = axum::serve(listener, router(app)) => served.map_err(ViewError::Start),
            () = ended => Ok(()),
        }
    })
}

fn router(app: App) -> Router {
    Router::new()
        .route("/{token}/", get(page::index))
        .route("/{token}/page/{file}", get(page::file))
        .route("/{token}/socket", any(socket))
        .route("/{token}/upload/{kind}", post(upload::upload))
        .route("/{token}/download/{file}", get(download::download))
        .fallback(|| async { (StatusCode::NOT_FOUND, "no such page") })
        .layer(DefaultBodyLimit::max(MAX_UPLOAD))
        .layer(from_fn_with_state(app.clone(), guard))
        .with_state(app)
}

/// Returns an address that a browser can open: the loopback address if the server listens on all interfaces.
fn reachable(mut address: SocketAddr) -> SocketAddr {
    if address.ip().is_unspecified() {
        address.set_ip(match address.ip() {
            IpAddr::V4(_) => IpAddr::V4(Ipv4Addr::LOCALHOST),
            IpAddr::V6(_) => IpAddr::V6(Ipv6Addr::LOCALHOST),
        });
    }
    address
}

/// Generates 128 random bits in hexadecimal.
fn random_token() -> Result<String, ViewError> {
    let mut bytes = [0; 16];
    getrandom::fill(&mut bytes).map_err(|error| ViewError::Start(std::io::Error::other(error.to_string())))?;
    let mut token = String::new();
    for byte in bytes {
        let _ = write!(token, "{byte:02x}");
    }
    Ok(token)
}

async fn socket(State(app): State<App>, upgrade: WebSocketUpgrade) -> Response {
    if app.session.pages.count() >= MAX_PAGES {
        return (StatusCode::SERVICE_UNAVAILABLE, "too many pages are open").into_response();
    }
    upgrade
        .max_message_size(MAX_MESSAGE)
        .max_frame_size(MAX_MESSAGE)
        .on_upgrade(move |socket| serve_socket(app, socket))
}

/// Relays messages between one page and the session.
async fn serve_socket(app: App, mut socket: WebSocket) {
    let outbox = app.session.join();
    loop {
        tokio::select! {
            received = socket.recv() => match received {
                Some(Ok(Message::Text(text))) => match serde_json::from_str::<FromPage>(&text) {
                    Ok(message) => app.session.receive(message, &outbox),
                    Err(error) => send(&outbox, &ToPage::Refused { why: format!("invalid message: {error}") }, &[]),
                },
                Some(Ok(Message::Binary(_))) => {
                    send(&outbox, &ToPage::Refused { why: "invalid message: messages must be text".into() }, &[]);
                }
                Some(Ok(Message::Ping(_) | Message::Pong(_))) => {}
                Some(Ok(Message::Close(_)) | Err(_)) | None => break,
            },
            message = outbox.next() => {
                let message = match &*message {
                    Encoded::Text(text) => Message::Text(text.clone().into()),
                    Encoded::Binary(bytes) => Message::Binary(bytes.clone().into()),
                };
                if socket.send(message).await.is_err() {
                    break;
                }
            }
        }
    }
    app.session.pages.leave(&outbox);
}
