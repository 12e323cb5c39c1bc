//! Who is let in: who knows the token, under an address of this machine, from this page.

use std::net::IpAddr;

use axum::extract::{Request, State};
use axum::http::{HeaderMap, HeaderName, HeaderValue, StatusCode, header};
use axum::middleware::Next;
use axum::response::{IntoResponse, Response};

use crate::server::App;
use crate::upload::MAX_UPLOAD;

/// What every answer says: nothing is kept, embedded, or loaded from elsewhere.
const HEADERS: [(HeaderName, &str); 5] = [
    (header::CACHE_CONTROL, "no-store"),
    (header::X_CONTENT_TYPE_OPTIONS, "nosniff"),
    (header::REFERRER_POLICY, "no-referrer"),
    (header::X_FRAME_OPTIONS, "DENY"),
    (
        header::CONTENT_SECURITY_POLICY,
        "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' blob:; connect-src 'self'; base-uri 'none'; \
         form-action 'none'; frame-ancestors 'none'",
    ),
];

/// Lets a request through or refuses it with a reason.
pub(crate) async fn guard(State(app): State<App>, request: Request, next: Next) -> Response {
    let path = request.uri().path().to_owned();
    let mut response = match refusal(request.headers(), &path, &app.token, app.port) {
        Some((status, why)) => (status, why).into_response(),
        None => next.run(request).await,
    };
    for (name, value) in HEADERS {
        response.headers_mut().insert(name, HeaderValue::from_static(value));
    }
    response
}

fn refusal(headers: &HeaderMap, path: &str, token: &str, port: u16) -> Option<(StatusCode, &'static str)> {
    let text = |name: HeaderName| headers.get(name).map(|value| value.to_str().unwrap_or_default());
    let host = text(header::HOST).unwrap_or_default();
    if !is_of_this_machine(host, port) {
        return Some((StatusCode::FORBIDDEN, "wrong Host: open the address that the program printed"));
    }
    if text(header::ORIGIN).is_some_and(|origin| origin.strip_prefix("http://") != Some(host)) {
        return Some((StatusCode::FORBIDDEN, "wrong Origin: another site's page may not ask here"));
    }
    let given = path.trim_start_matches('/').split('/').next().unwrap_or_default();
    if !is_same(given.as_bytes(), token.as_bytes()) {
        return Some((StatusCode::FORBIDDEN, "wrong token: open the address that the program printed"));
    }
    // Before any of it is read.
    if text(header::CONTENT_LENGTH)
        .and_then(|length| length.parse().ok())
        .is_some_and(|length: u64| length > MAX_UPLOAD as u64)
    {
        return Some((StatusCode::PAYLOAD_TOO_LARGE, "too large: at most 256 MB are taken"));
    }
    None
}

/// Names other than `localhost` can be made to lead here by whoever owns them; numbers cannot.
fn is_of_this_machine(host: &str, port: u16) -> bool {
    let Some((name, given)) = host.rsplit_once(':') else { return false };
    let name = name.trim_start_matches('[').trim_end_matches(']');
    given.parse() == Ok(port) && (name == "localhost" || name.parse::<IpAddr>().is_ok())
}

/// In a time that does not tell how much of it is right.
fn is_same(given: &[u8], token: &[u8]) -> bool {
    given.len() == token.len() && given.iter().zip(token).fold(0, |difference, (a, b)| difference | (a ^ b)) == 0
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn only_this_page_with_the_token_is_let_in() {
        let why = |host: &str, origin: Option<&str>, path: &str| {
            let mut headers = HeaderMap::new();
            headers.insert(header::HOST, host.parse().unwrap());
            if let Some(origin) = origin {
                headers.insert(header::ORIGIN, origin.parse().unwrap());
            }
            refusal(&headers, path, "secret", 8080).map(|(_, why)| why.split(':').next().unwrap().to_owned())
        };
        for (host, origin) in [
            ("127.0.0.1:8080", None),
            ("127.0.0.1:8080", Some("http://127.0.0.1:8080")),
            ("localhost:8080", Some("http://localhost:8080")),
            ("[::1]:8080", Some("http://[::1]:8080")),
        ] {
            assert_eq!(why(host, origin, "/secret/socket"), None, "{host} {origin:?}");
        }
        for host in ["evil.example:8080", "127.0.0.1:8081", "127.0.0.1", "", "127.0.0.1.evil.example:8080"] {
            assert_eq!(why(host, None, "/secret/"), Some("wrong Host".into()), "{host}");
        }
        for origin in ["http://evil.example", "https://127.0.0.1:8080", "null", "http://localhost:8080"] {
            assert_eq!(why("127.0.0.1:8080", Some(origin), "/secret/"), Some("wrong Origin".into()), "{origin}");
        }
        let mut headers = HeaderMap::new();
        headers.insert(header::HOST, "127.0.0.1:8080".parse().unwrap());
        headers.insert(header::CONTENT_LENGTH, (MAX_UPLOAD + 1).to_string().parse().unwrap());
        let status = refusal(&headers, "/secret/upload/photo", "secret", 8080).map(|(status, _)| status);
        assert_eq!(status, Some(StatusCode::PAYLOAD_TOO_LARGE));
        for path in ["/", "/secre/", "/secrets/", "/x/secret/", ""] {
            assert_eq!(why("127.0.0.1:8080", None, path), Some("wrong token".into()), "{path}");
        }
    }
}
