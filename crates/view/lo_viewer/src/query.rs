use axum::http::Uri;

/// Returns a finite number of an address's query: `…?u=1.5&v=2`.
pub(crate) fn query_number(uri: &Uri, name: &str) -> Option<f64> {
    let value = uri.query()?.split('&').find_map(|pair| pair.strip_prefix(name)?.strip_prefix('='))?;
    value.parse::<f64>().ok().filter(|value| value.is_finite())
}
