use std::net::{IpAddr, Ipv4Addr, Ipv6Addr, SocketAddr, UdpSocket};
use std::sync::Arc;
use std::time::Duration;

use axum::Router;
use axum::extract::State;
use axum::extract::ws::WebSocketUpgrade;
use axum::http::StatusCode;
use axum::middleware::from_fn_with_state;
use axum::response::Response;
use axum::routing::{any, get, post};
use tokio::net::TcpListener;

use crate::app::App;
use crate::guard::guard;
use crate::protocol::MAX_MESSAGE;
use crate::random_hex::random_hex;
use crate::recent::RecentRooms;
use crate::session_actor::SessionHandle;
use crate::{Options, Sample, ViewError, connections, download, page, page_socket, reopen, upload};

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
        None => random_hex::<16>()?,
    };
    let samples: Arc<[Sample]> = if options.estimator.is_some() { options.samples.into() } else { Arc::default() };
    let recent = options.recent.map(RecentRooms::new);
    let session = SessionHandle::start(options.warning_text, options.estimator.is_some(), samples.clone(), recent)?;
    if let Some(source) = options.source {
        session.open(source, None, None);
    }
    let ending = session.clone();
    let runtime = tokio::runtime::Builder::new_current_thread().enable_io().enable_time().build()?;
    let served = runtime.block_on(async move {
        let failed = |source| ViewError::Bind { address: format!("{}:{}", options.bind, options.port), source };
        let listener = TcpListener::bind((options.bind, options.port)).await.map_err(failed)?;
        let address = listener.local_addr()?;
        let public_origin = options.public_origin.map(Arc::new);
        on_ready(&match &public_origin {
            Some(origin) => format!("{origin}/{token}/"),
            None => format!("http://{}/{token}/", reachable(address)),
        });
        let app = App { session, token: token.into(), public_origin, estimator: options.estimator, samples };
        let ended = async {
            while !is_over() {
                tokio::time::sleep(POLL_INTERVAL).await;
            }
        };
        tokio::select! {
            () = connections::serve(listener, router(app)) => Ok(()),
            () = ended => Ok(()),
        }
    });
    ending.flush();
    // Jobs that still run must not delay the end of the program.
    runtime.shutdown_background();
    served
}

fn router(app: App) -> Router {
    Router::new()
        .route("/{token}/", get(page::index))
        .route("/{token}/page/{file}", get(page::file))
        .route("/{token}/socket", any(socket))
        .route("/{token}/upload/{kind}", post(upload::upload))
        .route("/{token}/download/{file}", get(download::download))
        .route("/{token}/sample/{index}", get(reopen::sample_photo).post(reopen::open_sample))
        .route(
            "/{token}/recent/{id}",
            get(reopen::recent_preview).post(reopen::open_recent).delete(reopen::forget_recent),
        )
        .fallback(|| async { (StatusCode::NOT_FOUND, "no such page") })
        .layer(from_fn_with_state(app.clone(), guard))
        .with_state(app)
}

/// Returns an address that browsers can open, those of other machines if the server listens on all interfaces and this
/// machine has a network.
fn reachable(mut address: SocketAddr) -> SocketAddr {
    let v4 = || network_ip(Ipv4Addr::UNSPECIFIED.into(), DOCUMENTATION_V4);
    address.set_ip(match address.ip() {
        IpAddr::V4(ip) if ip.is_unspecified() => v4().unwrap_or(Ipv4Addr::LOCALHOST.into()),
        IpAddr::V6(ip) if ip.is_unspecified() => {
            network_ip(Ipv6Addr::UNSPECIFIED.into(), DOCUMENTATION_V6).or_else(v4).unwrap_or(Ipv6Addr::LOCALHOST.into())
        }
        ip => ip,
    });
    address
}

/// Addresses of no machine (RFC 5737, RFC 3849).
const DOCUMENTATION_V4: IpAddr = IpAddr::V4(Ipv4Addr::new(192, 0, 2, 1));
const DOCUMENTATION_V6: IpAddr = IpAddr::V6(Ipv6Addr::new(0x2001, 0xdb8, 0, 0, 0, 0, 0, 1));

/// Returns the address of this machine from which it would send to `target`. Nothing is sent.
fn network_ip(any: IpAddr, target: IpAddr) -> Option<IpAddr> {
    let socket = UdpSocket::bind((any, 0)).ok()?;
    socket.connect((target, 9)).ok()?;
    Some(socket.local_addr().ok()?.ip()).filter(|ip| !ip.is_unspecified() && !ip.is_loopback())
}

async fn socket(State(app): State<App>, upgrade: WebSocketUpgrade) -> Response {
    upgrade
        .max_message_size(MAX_MESSAGE)
        .max_frame_size(MAX_MESSAGE)
        .on_upgrade(move |socket| page_socket::serve(app, socket))
}
