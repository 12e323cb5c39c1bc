use std::fmt;
use std::str::FromStr;

use axum::http::uri::Authority;

/// The address under which browsers reach the page through a proxy: scheme and host, without a path.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct PublicOrigin {
    is_https: bool,
    authority: String,
}

impl PublicOrigin {
    /// Returns whether the connection to browsers is encrypted.
    pub fn is_https(&self) -> bool {
        self.is_https
    }

    /// Returns the host, with its port if that is not the scheme's default.
    pub(crate) fn authority(&self) -> &str {
        &self.authority
    }
}

impl FromStr for PublicOrigin {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let wrong = || format!("{text} is not an origin: expected https://HOST or http://HOST:PORT without a path");
        let (is_https, rest) = match (text.strip_prefix("https://"), text.strip_prefix("http://")) {
            (Some(rest), _) => (true, rest),
            (None, Some(rest)) => (false, rest),
            (None, None) => return Err(wrong()),
        };
        let rest = rest.strip_suffix('/').unwrap_or(rest).to_ascii_lowercase();
        let authority: Authority = rest.parse().map_err(|_| wrong())?;
        if authority.host().is_empty() || rest.contains('@') {
            return Err(wrong());
        }
        // Browsers omit the scheme's default port in `Host` and `Origin`.
        let default_port = if is_https { ":443" } else { ":80" };
        Ok(Self { is_https, authority: rest.strip_suffix(default_port).unwrap_or(&rest).to_owned() })
    }
}

impl fmt::Display for PublicOrigin {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}://{}", if self.is_https { "https" } else { "http" }, self.authority)
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn origins_are_scheme_and_host_alone() {
        let read = |text: &str| text.parse::<PublicOrigin>().map(|origin| origin.to_string());
        for (text, expected) in [
            ("https://light.example", "https://light.example"),
            ("https://Light.Example/", "https://light.example"),
            ("https://light.example:443", "https://light.example"),
            ("http://light.example:80", "http://light.example"),
            ("http://studio:8080", "http://studio:8080"),
            ("https://[2001:db8::1]:8443", "https://[2001:db8::1]:8443"),
        ] {
            assert_eq!(read(text).as_deref(), Ok(expected));
        }
        for text in ["light.example", "ftp://light.example", "https://", "https://a/b", "https://me@a", "https://a b"] {
            assert!(read(text).unwrap_err().contains("is not an origin"), "{text}");
        }
    }
}
