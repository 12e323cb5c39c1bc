//! Lines of OBJ and MTL files.

use std::borrow::Cow;

/// Iterates over lines with their numbers (from 1), without comments. A backslash at the end joins the next line.
pub(super) fn logical_lines(bytes: &[u8]) -> impl Iterator<Item = (usize, Cow<'_, str>)> {
    let mut lines = bytes.split(|&byte| byte == b'\n').enumerate();
    std::iter::from_fn(move || {
        let (number, first) = lines.next()?;
        let mut line = clean(first);
        while line.ends_with('\\') {
            let joined = line.to_mut();
            joined.pop();
            joined.push(' ');
            joined.push_str(&lines.next().map(|(_, next)| clean(next)).unwrap_or_default());
        }
        Some((number + 1, line))
    })
}

pub(super) fn clean(line: &[u8]) -> Cow<'_, str> {
    String::from_utf8_lossy(without_comment(line))
}

pub(super) fn without_comment(line: &[u8]) -> &[u8] {
    line.split(|&byte| byte == b'#').next().unwrap_or_default().trim_ascii()
}

/// Returns a keyword in lower case; some programs write them in capitals.
pub(super) fn in_lower_case(keyword: &str) -> Cow<'_, str> {
    if keyword.bytes().any(|byte| byte.is_ascii_uppercase()) {
        keyword.to_ascii_lowercase().into()
    } else {
        keyword.into()
    }
}
