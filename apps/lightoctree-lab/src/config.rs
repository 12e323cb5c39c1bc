//! Configurations: TOML files with the fields that differ from the defaults, and overrides of single fields.

use std::fmt::Display;
use std::path::{Path, PathBuf};

use anyhow::Context;
use lightoctree_cli::usage::Usage;
use serde::Serialize;
use serde::de::DeserializeOwned;
use toml::{Table, Value};

/// Options of commands that have a configuration.
#[derive(Debug, clap::Args)]
pub struct ConfigArgs {
    /// Configuration: TOML with the fields of --print-config that differ from the defaults
    #[arg(long, value_name = "FILE.toml")]
    pub config: Option<PathBuf>,

    /// Override one field of the configuration, such as room.crop_size=[480,320] or light.0.steps=500; repeatable
    ///
    /// FIELD is a path of keys, and of positions in lists, counted from 0. VALUE is TOML; other text is a string.
    #[arg(long, value_name = "FIELD=VALUE")]
    pub set: Vec<String>,

    /// Print the configuration with all fields, and exit
    #[arg(long)]
    pub print_config: bool,
}

impl ConfigArgs {
    /// Reads the configuration of `--config`, else of `file`, else the default, and applies `--set`.
    ///
    /// # Errors
    /// The file cannot be read; a field is unknown or has a wrong type.
    pub fn read<T>(&self, file: Option<&Path>) -> anyhow::Result<T>
    where
        T: Default + Serialize + DeserializeOwned,
    {
        let mut config = self.config.as_deref().or(file).map_or_else(|| Ok(T::default()), read)?;
        for assignment in &self.set {
            config = assigned(&config, assignment).map_err(|reason| Usage(format!("--set {assignment}: {reason}")))?;
        }
        Ok(config)
    }

    /// Returns an invalid value of [`ConfigArgs::read`] as an error of usage that names the file read.
    pub fn invalid(&self, file: Option<&Path>, error: impl Display) -> Usage {
        match self.config.as_deref().or(file) {
            Some(path) => Usage(format!("{}: {error}", path.display())),
            None => Usage(error.to_string()),
        }
    }
}

/// Reads a configuration file. Errors name the file, the line and its text.
pub fn read<T: DeserializeOwned>(path: &Path) -> anyhow::Result<T> {
    let text = std::fs::read_to_string(path).with_context(|| format!("cannot read {}", path.display()))?;
    parse(&text).map_err(|reason| Usage(format!("{}: {reason}", path.display())).into())
}

/// Returns a configuration with all fields, in the format of [`read`].
pub fn text<T: Serialize>(config: &T) -> anyhow::Result<String> {
    toml::to_string(config).context("cannot write the configuration as TOML")
}

/// Returns a configuration with one field replaced, by an assignment such as `room.shots=3`.
fn assigned<T: Serialize + DeserializeOwned>(config: &T, assignment: &str) -> Result<T, String> {
    let (field, text) = assignment.split_once('=').ok_or("expected FIELD=VALUE")?;
    let value = toml::from_str::<Table>(&format!("value = {text}")).ok().and_then(|mut parsed| parsed.remove("value"));
    let mut root = Value::Table(Table::try_from(config).map_err(|error| error.to_string())?);
    let mut keys = field.trim().split('.').peekable();
    let mut parent = &mut root;
    while let Some(key) = keys.next() {
        // Fields without a value are not in the table.
        let absent = if keys.peek().is_some() { Value::Table(Table::new()) } else { Value::String(String::new()) };
        let kind = parent.type_str();
        parent = match parent {
            Value::Table(table) => table.entry(key).or_insert(absent),
            Value::Array(list) => {
                let length = list.len();
                let item = key.parse().ok().and_then(|index: usize| list.get_mut(index));
                item.ok_or_else(|| format!("`{key}` is not a position in a list of {length}, counted from 0"))?
            }
            _ => return Err(format!("`{key}` is not a field: its parent is of type {kind}")),
        };
    }
    *parent = value.unwrap_or_else(|| Value::String(text.trim().to_owned()));
    root.try_into().map_err(|error: toml::de::Error| error.message().to_owned())
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
    fn single_fields_are_overridden() {
        let set = |assignment: &str| assigned(&GeneratorConfig::default(), assignment);
        let default = GeneratorConfig::default();
        assert_eq!(set("shots=3").unwrap(), GeneratorConfig { shots: 3, ..default.clone() });
        assert_eq!(set("room.crop_size = [480, 320]").unwrap().room.crop_size, [480, 320]);
        assert_eq!(set("room.crop_size.1=320").unwrap().room.crop_size, [default.room.crop_size[0], 320]);
        let folders = set("room.picture_folders=[\"a b\"]").unwrap().room.picture_folders;
        assert_eq!(folders, [Path::new("a b")]);
        for (assignment, message) in [
            ("shots", "expected FIELD=VALUE"),
            ("room.pitch=3", "unknown field `pitch`, expected one of"),
            ("shots=many", "invalid type: string \"many\", expected u32"),
            ("room.crop_size.2=3", "`2` is not a position in a list of 2"),
            ("shots.a=3", "`a` is not a field: its parent is of type integer"),
        ] {
            let found = set(assignment).unwrap_err();
            assert!(found.contains(message), "{assignment}: {found}");
        }
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
