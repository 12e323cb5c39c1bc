//! The token in the viewer's address: from a file, the environment or the command line.

use std::collections::HashSet;
use std::path::PathBuf;

use anyhow::Context;

/// Environment variable with the token.
const VARIABLE: &str = "LIGHTOCTREE_TOKEN";

/// Longest token file, bytes.
const MAX_FILE_BYTES: u64 = 4096;

/// Fewest different characters of a token.
const MIN_DIFFERENT: usize = 8;

/// Longest run of equal or consecutive characters.
const MAX_RUN: usize = 4;

/// Parts of tokens that everybody tries first, and of examples in documents.
const COMMON: [&str; 11] = [
    "password",
    "passwort",
    "secret",
    "token",
    "lightoctree",
    "qwerty",
    "letmein",
    "changeme",
    "example",
    "admin",
    "welcome",
];

/// Options of the token.
#[derive(Debug, clap::Args)]
pub struct TokenArgs {
    /// Token in the address: 16 to 200 letters, digits and hyphens, hard to guess; visible to other users of this
    /// machine, unlike --token-file and the variable LIGHTOCTREE_TOKEN [default: random]
    #[arg(long, value_name = "TOKEN", value_parser = checked)]
    token: Option<String>,

    /// File whose only line is the token
    #[arg(long, value_name = "FILE", conflicts_with = "token")]
    token_file: Option<PathBuf>,
}

impl TokenArgs {
    /// Returns the token from the command line, the file or the environment; `None` for a random one.
    ///
    /// # Errors
    /// If the file cannot be read, or the token is weak.
    pub fn token(&self) -> anyhow::Result<Option<String>> {
        if let Some(token) = &self.token {
            return Ok(Some(token.clone()));
        }
        if let Some(path) = &self.token_file {
            let text = lo_imaging::read_regular_text(path, MAX_FILE_BYTES)
                .with_context(|| format!("cannot read {}", path.display()))?;
            let token = checked(text.trim()).map_err(anyhow::Error::msg);
            return Ok(Some(token.with_context(|| format!("--token-file {}", path.display()))?));
        }
        match std::env::var(VARIABLE) {
            Ok(token) => Ok(Some(checked(token.trim()).map_err(anyhow::Error::msg).context(VARIABLE)?)),
            Err(std::env::VarError::NotPresent) => Ok(None),
            Err(error) => Err(error).context(VARIABLE),
        }
    }
}

/// Parses a token.
fn checked(token: &str) -> Result<String, String> {
    let is_plain = token.chars().all(|c| c.is_ascii_alphanumeric() || c == '-');
    if !((16..=200).contains(&token.len()) && is_plain) {
        return Err("a token consists of 16 to 200 letters, digits and hyphens".to_owned());
    }
    match weakness(token) {
        Some(why) => Err(format!("the token is easy to guess: it {why}; omit it for a random one")),
        None => Ok(token.to_owned()),
    }
}

/// Describes why a token is easy to guess.
fn weakness(token: &str) -> Option<String> {
    let bytes = token.to_ascii_lowercase().into_bytes();
    let different = bytes.iter().collect::<HashSet<_>>().len();
    if different < MIN_DIFFERENT {
        return Some(format!("has only {different} different characters"));
    }
    if (1..=bytes.len() / 2).any(|period| bytes.iter().zip(&bytes[period..]).all(|(a, b)| a == b)) {
        return Some("repeats itself".to_owned());
    }
    for step in [-1, 0, 1] {
        let follows = |pair: &[u8]| i16::from(pair[1]) - i16::from(pair[0]) == step;
        let runs = bytes.windows(2).map(follows).collect::<Vec<_>>();
        if runs.split(|follows| !follows).any(|run| run.len() >= MAX_RUN) {
            return Some("has a run of equal or consecutive characters".to_owned());
        }
    }
    let text = String::from_utf8_lossy(&bytes);
    COMMON.iter().find(|word| text.contains(**word)).map(|word| format!("contains \"{word}\""))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn weak_tokens_are_refused() {
        for (token, why) in [
            ("short", "16 to 200"),
            ("kV8-zu3_pQ7-mX2-wR9", "16 to 200"),
            ("aaaaaaaaaaaaaaaaaaaa", "1 different"),
            ("2024-11-29-2024-11", "different"),
            ("kv8zu3pq7mkv8zu3pq7m", "repeats"),
            ("kv8zu3pq-12345-wr9x", "run"),
            ("kv8zu3pq-edcba-wr9x", "run"),
            ("my-Password-kv8zu3", "\"password\""),
            ("a-long-secret-of-mine", "\"secret\""),
        ] {
            let error = checked(token).err().unwrap_or_default();
            assert!(error.contains(why), "{token}: {error}");
        }
        for token in ["kV8-zu3-pQ7-mX2-wR9", "0123a5f09b7c4de18a2f6b3c9d05e7f1"] {
            assert_eq!(checked(token).as_deref(), Ok(token));
        }
    }
}
