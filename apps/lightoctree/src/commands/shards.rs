//! Folders of shards that one or several runs fill, each going on where others stopped.

use std::path::{Path, PathBuf};

use anyhow::Context;
use dataset::shard_name;
use serde_json::Value;

use super::environment::write_json;
use crate::{Usage, output};

const MANIFEST: &str = "manifest.json";

/// A folder with a manifest of what its shards are made from, and those that are finished.
pub struct ShardFolder<'a> {
    path: &'a Path,
    prefix: &'static str,
}

impl<'a> ShardFolder<'a> {
    /// Makes the folder, or takes up what an earlier run of the same command with the same `manifest` left in it.
    ///
    /// The manifest is an object of everything that the shards' bytes depend on: shards of two kinds must not lie side by side. With `force`
    /// the shards of another manifest are removed.
    pub fn open(
        path: &'a Path,
        prefix: &'static str,
        command: &str,
        manifest: &Value,
        force: bool,
    ) -> anyhow::Result<Self> {
        output::prepare_folder(path, MANIFEST, command, force)?;
        let this = Self { path, prefix };
        let file = path.join(MANIFEST);
        let Some(existing) = read(&file, force)? else {
            write_json(&file, command, manifest.clone())?;
            return Ok(this);
        };
        let fields = manifest.as_object().into_iter().flatten();
        match fields.into_iter().find(|(key, value)| existing.get(key) != Some(value)) {
            None => {}
            Some((key, _)) if !force => {
                return Err(Usage(format!(
                    "{} was begun with another {key}; repeat that command, or choose another folder",
                    path.display()
                ))
                .into());
            }
            Some(_) => {
                // before the manifest is replaced: a run killed in between must not leave them to be taken for its own
                this.remove_shards()?;
                write_json(&file, command, manifest.clone())?;
            }
        }
        Ok(this)
    }

    /// Where shard `number` lies or will lie.
    pub fn shard(&self, number: usize) -> PathBuf {
        self.path.join(shard_name(self.prefix, number))
    }

    /// Whether it is finished: a shard appears whole or not at all.
    pub fn has(&self, number: usize) -> bool {
        self.shard(number).exists()
    }

    fn remove_shards(&self) -> anyhow::Result<()> {
        let cannot = || format!("cannot clear {}", self.path.display());
        for entry in std::fs::read_dir(self.path).with_context(cannot)? {
            let entry = entry.with_context(cannot)?;
            let name = entry.file_name();
            let number = name.to_str().and_then(|name| {
                name.strip_prefix(self.prefix)?.strip_prefix('-')?.strip_suffix(".tar")?.parse::<usize>().ok()
            });
            // only names that this command writes
            if number.is_some_and(|number| *shard_name(self.prefix, number) == *name) {
                std::fs::remove_file(entry.path()).with_context(cannot)?;
            }
        }
        Ok(())
    }
}

/// The manifest that is there; with `force`, one that is no JSON counts as another one.
fn read(file: &Path, force: bool) -> anyhow::Result<Option<Value>> {
    match std::fs::read(file) {
        Ok(bytes) => match serde_json::from_slice(&bytes) {
            Ok(manifest) => Ok(Some(manifest)),
            Err(_) if force => Ok(Some(Value::Null)),
            Err(error) => Err(error).with_context(|| file.display().to_string()),
        },
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => Ok(None),
        Err(error) => Err(error).with_context(|| format!("cannot read {}", file.display())),
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use serde_json::json;

    use super::*;

    #[test]
    fn finished_shards_stay_with_their_manifest_and_go_with_another() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("rooms");
        let open = |seed: u32, force: bool| {
            ShardFolder::open(&path, "rooms", "synth", &json!({ "seed": seed, "scenes": 9 }), force)
        };
        let shards = open(1, false).unwrap();
        std::fs::write(shards.shard(2), "finished").unwrap();
        for other in ["rooms-7.tar", "rooms-000002.tar.old", "letter.txt"] {
            std::fs::write(path.join(other), "not ours").unwrap();
        }
        assert!(open(1, false).unwrap().has(2) && open(1, true).unwrap().has(2));
        let refusal = open(2, false).err().unwrap();
        assert!(refusal.is::<Usage>() && refusal.to_string().contains("another seed"), "{refusal}");
        assert!(!open(2, true).unwrap().has(2), "of another seed");
        assert_eq!(std::fs::read_dir(&path).unwrap().count(), 4, "what is not ours stays, beside the manifest");
        assert!(open(2, false).is_ok() && open(1, false).is_err());
    }
}
