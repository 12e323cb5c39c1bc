//! Configuration files: TOML with the fields that differ from the defaults.

use std::path::Path;

use anyhow::Context;
use lightoctree_cli::usage::Usage;
use serde::Serialize;
use serde::de::DeserializeOwned;

/// Reads a configuration. Errors name the file, the line and its text.
pub fn read<T: DeserializeOwned>(path: &Path) -> anyhow::Result<T> {
    let text = std::fs::read_to_string(path).with_context(|| format!("cannot read {}", path.display()))?;
    parse(&text).map_err(|reason| Usage(format!("{}: {reason}", path.display())).into())
}

/// Returns a configuration with all fields, in the format of [`read`].
pub fn text<T: Serialize>(config: &T) -> anyhow::Result<String> {
    toml::to_string(config).context("cannot write the configuration as TOML")
}

fn parse<T: DeserializeOwned>(text: &str) -> Result<T, String> {
    toml::from_str(text).map_err(|error| {
        // Errors may have no position, or one beyond the last line (an unterminated table).
        let line = error.span().and_then(|span| {
            let number = text.get(..span.start)?.matches('\n').count();
            Some((number, text.lines().nth(number)?.trim()))
        });
        match line {
            Some((number, line)) => format!("line {} ({line}): {}", number + 1, error.message()),
            None => error.message().to_owned(),
        }
    })
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use lo_dataset::GeneratorConfig;

    use super::*;

    #[test]
    fn every_field_is_printed_and_read_back() {
        let config = GeneratorConfig { shots: 3, ..GeneratorConfig::default() };
        assert_eq!(parse::<GeneratorConfig>(&text(&config).unwrap()).unwrap(), config);
        assert_eq!(parse::<GeneratorConfig>("").unwrap(), GeneratorConfig::default());
    }

    #[test]
    fn errors_name_line_and_field() {
        let message = |text: &str| parse::<GeneratorConfig>(text).unwrap_err();
        let unknown = message("shots = 2\n\n[room]\n  pitch = 3.0\n");
        assert!(unknown.starts_with("line 4 (pitch = 3.0): unknown field `pitch`, expected one of"), "{unknown}");
        let kind = message("[room.room_weights]\nkitchen = 1\nballroom = 2\n");
        assert!(kind.starts_with("line 3 (ballroom = 2): unknown variant `ballroom`"), "{kind}");
        let wrong = message("shots = \"many\"");
        assert!(wrong.starts_with("line 1 (shots = \"many\"): invalid type: string \"many\", expected u32"), "{wrong}");
        let twice = message("shots = 2\nshots = 3");
        assert!(twice.starts_with("line 2 (shots = 3): duplicate key"), "{twice}");
        assert!(message("[room\nshots = 1").starts_with("line 1 ([room): "), "{}", message("[room\nshots = 1"));
    }
}
