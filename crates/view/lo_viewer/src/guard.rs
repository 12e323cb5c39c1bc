//! Access control: requests need the token, a `Host` of this machine or of the public origin, and this page's `Origin`.

use std::net::{Ipv4Addr, Ipv6Addr};

use axum::extract::{Request, State};
use axum::http::{HeaderMap, HeaderName, HeaderValue, StatusCode, Uri, header};
use axum::middleware::Next;
use axum::response::{IntoResponse, Response};

use crate::app::App;
use crate::connections::Trusted;
use crate::origin::PublicOrigin;
use crate::uploads::MAX_UPLOAD;

/// Headers of every response: nothing is cached, embedded, shared with other origins, or loaded from elsewhere.
const HEADERS: [(HeaderName, &str); 7] = [
    (header::CACHE_CONTROL, "no-store"),
    (header::X_CONTENT_TYPE_OPTIONS, "nosniff"),
    (header::REFERRER_POLICY, "no-referrer"),
    (header::X_FRAME_OPTIONS, "DENY"),
    (HeaderName::from_static("cross-origin-resource-policy"), "same-origin"),
    (HeaderName::from_static("cross-origin-opener-policy"), "same-origin"),
    (
        header::CONTENT_SECURITY_POLICY,
        "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' blob:; connect-src 'self'; base-uri 'none'; \
         form-action 'none'; frame-ancestors 'none'",
    ),
];

/// Passes a request on, or refuses it with a reason.
pub(crate) async fn guard(State(app): State<App>, request: Request, next: Next) -> Response {
    let refused = refusal(request.headers(), request.uri(), &app.token, app.public_origin.as_deref());
    let mut response = match refused {
        Some((status, why)) => (status, why).into_response(),
        None => {
            if let Some(trusted) = request.extensions().get::<Trusted>() {
                trusted.set();
            }
            next.run(request).await
        }
    };
    for (name, value) in HEADERS {
        response.headers_mut().insert(name, HeaderValue::from_static(value));
    }
    response
}

fn refusal(
    headers: &HeaderMap,
    uri: &Uri,
    token: &str,
    public: Option<&PublicOrigin>,
) -> Option<(StatusCode, &'static str)> {
    let text = |name: HeaderName| headers.get(name).map(|value| value.to_str().unwrap_or_default());
    let host = text(header::HOST).unwrap_or_default();
    let names_another = uri.authority().is_some_and(|authority| !authority.as_str().eq_ignore_ascii_case(host));
    if headers.get_all(header::HOST).iter().count() > 1 || names_another {
        return Some((StatusCode::BAD_REQUEST, "the request names more than one host"));
    }
    let is_public = public.is_some_and(|public| public.authority().eq_ignore_ascii_case(host));
    if !is_public && !is_of_this_machine(host) {
        let why = "wrong Host: open the address that the program printed; behind a proxy start it with --public-origin";
        return Some((StatusCode::FORBIDDEN, why));
    }
    let is_own = |origin: &str| {
        origin.strip_prefix("http://") == Some(host) || public.is_some_and(|public| public.to_string() == origin)
    };
    if text(header::ORIGIN).is_some_and(|origin| !is_own(origin)) {
        let why =
            "wrong Origin: only this page may send requests; behind a proxy start the program with --public-origin";
        return Some((StatusCode::FORBIDDEN, why));
    }
    let given = uri.path().trim_start_matches('/').split('/').next().unwrap_or_default();
    if !is_same(given.as_bytes(), token.as_bytes()) {
        return Some((StatusCode::FORBIDDEN, "wrong token: open the address that the program printed"));
    }
    // Before any of it is read.
    if text(header::CONTENT_LENGTH)
        .and_then(|length| length.parse().ok())
        .is_some_and(|length: u64| length > MAX_UPLOAD as u64)
    {
        return Some((StatusCode::PAYLOAD_TOO_LARGE, "too large: at most 256 MB are accepted"));
    }
    None
}

/// Returns whether a host is `localhost` or an IP address. Other names can be made to resolve to this machine by
/// whoever owns them (DNS rebinding). Any port passes: tunnels change it, and `Origin` has to name the same one.
fn is_of_this_machine(host: &str) -> bool {
    let name = match host.rsplit_once(':') {
        Some((name, port)) if port.parse::<u16>().is_ok() => name,
        _ => host,
    };
    let unbracketed = name.strip_prefix('[').and_then(|name| name.strip_suffix(']'));
    name == "localhost"
        || unbracketed.map_or_else(|| name.parse::<Ipv4Addr>().is_ok(), |name| name.parse::<Ipv6Addr>().is_ok())
}

/// Compares in constant time.
fn is_same(given: &[u8], token: &[u8]) -> bool {
    given.len() == token.len() && given.iter().zip(token).fold(0, |difference, (a, b)| difference | (a ^ b)) == 0
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    fn refused(hosts: &[&str], origin: Option<&str>, uri: &str, public: Option<&str>) -> Option<String> {
        let mut headers = HeaderMap::new();
        for host in hosts {
            headers.append(header::HOST, host.parse().unwrap());
        }
        if let Some(origin) = origin {
            headers.insert(header::ORIGIN, origin.parse().unwrap());
        }
        let public: Option<PublicOrigin> = public.map(|public| public.parse().unwrap());
        let (_, why) = refusal(&headers, &uri.parse().unwrap(), "secret", public.as_ref())?;
        Some(why.split(':').next().unwrap().to_owned())
    }

    #[test]
    fn only_this_page_with_the_token_is_let_in() {
        for (host, origin) in [
            ("127.0.0.1:8080", None),
            ("127.0.0.1:8080", Some("http://127.0.0.1:8080")),
            ("localhost:8080", Some("http://localhost:8080")),
            ("localhost", Some("http://localhost")),
            ("192.168.0.7", Some("http://192.168.0.7")),
            ("[::1]:8080", Some("http://[::1]:8080")),
        ] {
            assert_eq!(refused(&[host], origin, "/secret/socket", None), None, "{host} {origin:?}");
        }
        for host in ["evil.example:8080", "", "127.0.0.1.evil.example:8080", "[localhost]", "::1:8080", "localhost:x"] {
            assert_eq!(refused(&[host], None, "/secret/", None), Some("wrong Host".into()), "{host}");
        }
        for origin in ["http://evil.example", "https://127.0.0.1:8080", "null", "http://127.0.0.1:8081"] {
            let why = refused(&["127.0.0.1:8080"], Some(origin), "/secret/", None);
            assert_eq!(why, Some("wrong Origin".into()), "{origin}");
        }
        for path in ["/", "/secre/", "/secrets/", "/x/secret/"] {
            assert_eq!(refused(&["127.0.0.1:8080"], None, path, None), Some("wrong token".into()), "{path}");
        }
    }

    #[test]
    fn requests_name_one_host() {
        let two = Some("the request names more than one host".to_owned());
        assert_eq!(refused(&["127.0.0.1:8080", "evil.example"], None, "/secret/", None), two);
        assert_eq!(refused(&["127.0.0.1:8080"], None, "http://evil.example/secret/", None), two);
        assert_eq!(refused(&["127.0.0.1:8080"], None, "http://127.0.0.1:8080/secret/", None), None);
    }

    #[test]
    fn a_proxy_has_the_public_origin() {
        let public = Some("https://light.example");
        for host in ["light.example", "127.0.0.1:8080"] {
            assert_eq!(refused(&[host], Some("https://light.example"), "/secret/socket", public), None, "{host}");
        }
        let origin = Some("https://evil.example");
        assert_eq!(refused(&["light.example"], origin, "/secret/", public), Some("wrong Origin".into()));
        assert_eq!(refused(&["evil.example"], None, "/secret/", public), Some("wrong Host".into()));
    }

    #[test]
    fn long_bodies_are_refused_unread() {
        let mut headers = HeaderMap::new();
        headers.insert(header::HOST, "127.0.0.1:8080".parse().unwrap());
        headers.insert(header::CONTENT_LENGTH, (MAX_UPLOAD + 1).to_string().parse().unwrap());
        let status =
            refusal(&headers, &"/secret/upload/photo".parse().unwrap(), "secret", None).map(|refused| refused.0);
        assert_eq!(status, Some(StatusCode::PAYLOAD_TOO_LARGE));
    }
}
