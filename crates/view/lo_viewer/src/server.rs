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
use crate::outbox::tell;
use crate::pool::MAX_UPLOAD;
use crate::protocol::{Encoded, FromPage, MAX_MESSAGE, ToPage};
use crate::session_actor::SessionHandle;
use crate::{Options, ViewError, download, page, upload};

/// Most pages at a time.
const MAX_PAGES: usize = 16;

/// How often one looks whether the program is to end.
const LOOK: Duration = Duration::from_millis(100);

/// Serves the page until `is_over`; `on_ready` hears its address.
///
/// # Errors
/// Where the address cannot be had, or the system lacks threads or random numbers.
pub fn run(
    options: Options,
    on_ready: impl FnOnce(&str),
    is_over: impl Fn() -> bool + Send + 'static,
) -> Result<(), ViewError> {
    let token = match &options.token {
        Some(token) => token.clone(),
        None => random_token()?,
    };
    let session = SessionHandle::start(options.text, options.estimator.is_some())?;
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
                tokio::time::sleep(LOOK).await;
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
        .fallback(|| async { (StatusCode::NOT_FOUND, "there is no such page") })
        .layer(DefaultBodyLimit::max(MAX_UPLOAD))
        .layer(from_fn_with_state(app.clone(), guard))
        .with_state(app)
}

/// An address that a browser can open: where all interfaces are listened at, this machine's own.
fn reachable(mut address: SocketAddr) -> SocketAddr {
    if address.ip().is_unspecified() {
        address.set_ip(match address.ip() {
            IpAddr::V4(_) => IpAddr::V4(Ipv4Addr::LOCALHOST),
            IpAddr::V6(_) => IpAddr::V6(Ipv6Addr::LOCALHOST),
        });
    }
    address
}

/// 128 bits in hexadecimal digits.
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
    upgrade.max_message_size(MAX_MESSAGE).max_frame_size(MAX_MESSAGE).on_upgrade(move |socket| talk(app, socket))
}

/// Carries messages between one page and the desk.
async fn talk(app: App, mut socket: WebSocket) {
    let outbox = app.session.join();
    loop {
        tokio::select! {
            heard = socket.recv() => match heard {
                Some(Ok(Message::Text(text))) => match serde_json::from_str::<FromPage>(&text) {
                    Ok(message) => app.session.say(message, &outbox),
                    Err(error) => tell(&outbox, &ToPage::Refused { why: format!("not understood: {error}") }, &[]),
                },
                Some(Ok(Message::Binary(_))) => {
                    tell(&outbox, &ToPage::Refused { why: "not understood: messages are text".into() }, &[]);
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
