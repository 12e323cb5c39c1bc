use std::fmt::Write;
use std::sync::{Arc, Mutex};
use std::time::Duration;

use axum::Router;
use axum::extract::ws::{Message, WebSocket, WebSocketUpgrade};
use axum::extract::{DefaultBodyLimit, State};
use axum::http::StatusCode;
use axum::middleware::from_fn_with_state;
use axum::response::{IntoResponse, Response};
use axum::routing::{any, get, post};
use tokio::net::TcpListener;

use crate::desk::Desk;
use crate::guard::guard;
use crate::outbox::tell;
use crate::protocol::{Encoded, FromPage, MAX_MESSAGE, ToPage};
use crate::upload::{MAX_UPLOAD, Pool};
use crate::{MakeEstimator, Options, ViewError, download, page, upload};

/// Most pages at a time.
const MAX_PAGES: usize = 16;

/// How often one looks whether the program is to end.
const LOOK: Duration = Duration::from_millis(100);

/// What the answers to requests share.
#[derive(Clone)]
pub(crate) struct App {
    pub desk: Arc<Desk>,
    pub token: Arc<str>,
    pub port: u16,
    pub estimator: Option<MakeEstimator>,
    /// Files that wait for the one that names them.
    pub pool: Arc<Mutex<Pool>>,
}

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
    let desk = Desk::start(options.words, options.estimator.is_some())?;
    if let Some(source) = options.source {
        desk.open(source);
    }
    let runtime = tokio::runtime::Builder::new_current_thread().enable_io().enable_time().build()?;
    runtime.block_on(async move {
        let failed = |source| ViewError::Bind { address: format!("{}:{}", options.bind, options.port), source };
        let listener = TcpListener::bind((options.bind, options.port)).await.map_err(failed)?;
        let address = listener.local_addr()?;
        on_ready(&format!("http://{address}/{token}/"));
        let app =
            App { desk, token: token.into(), port: address.port(), estimator: options.estimator, pool: Arc::default() };
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
    if app.desk.pages.count() >= MAX_PAGES {
        return (StatusCode::SERVICE_UNAVAILABLE, "too many pages are open").into_response();
    }
    upgrade.max_message_size(MAX_MESSAGE).max_frame_size(MAX_MESSAGE).on_upgrade(move |socket| talk(app, socket))
}

/// Carries messages between one page and the desk.
async fn talk(app: App, mut socket: WebSocket) {
    let outbox = app.desk.join();
    loop {
        tokio::select! {
            heard = socket.recv() => match heard {
                Some(Ok(Message::Text(text))) => match serde_json::from_str::<FromPage>(&text) {
                    Ok(message) => app.desk.say(message, &outbox),
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
    app.desk.pages.leave(&outbox);
}
