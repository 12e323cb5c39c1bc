//! Folders of shards that one or several runs fill. Each run continues where others stopped.

use std::io::Write;
use std::path::{Path, PathBuf};

use lo_imaging::write_atomically;
use serde_json::Value;

use super::write::shard_name;
use crate::DatasetError;

/// File that describes what the shards of a folder are made from.
const MANIFEST: &str = "manifest.json";

/// Field of a manifest that names the program. Shards do not depend on it.
const GENERATOR: &str = "generator";

/// Folder with finished shards and a manifest of what they are made from.
#[derive(Debug)]
pub struct ShardFolder {
    path: PathBuf,
    prefix: String,
    generator: String,
}

impl ShardFolder {
    /// Name of the file that describes what the shards are made from.
    pub const MANIFEST: &str = MANIFEST;

    /// Creates the folder, or continues an earlier run with the same `manifest`.
    ///
    /// The manifest is an object with everything that the shards' bytes depend on, and `generator`. Shards with
    /// different manifests must not be mixed. With `replace`, shards of another manifest are removed.
    ///
    /// # Errors
    /// [`DatasetError::OtherManifest`] without `replace`, and file system errors.
    pub fn open(path: &Path, prefix: &str, manifest: &Value, replace: bool) -> Result<Self, DatasetError> {
        std::fs::create_dir_all(path).map_err(DatasetError::io(path))?;
        let generator = manifest[GENERATOR].as_str().unwrap_or(lo_imaging::GENERATOR).to_owned();
        let this = Self { path: path.to_owned(), prefix: prefix.to_owned(), generator };
        let file = path.join(MANIFEST);
        let Some(existing) = read(&file, replace)? else {
            write(&file, manifest)?;
            return Ok(this);
        };
        let fields = manifest.as_object().into_iter().flatten().filter(|(key, _)| *key != GENERATOR);
        match fields.into_iter().find(|(key, value)| existing.get(key) != Some(value)) {
            None => {}
            Some((key, _)) if !replace => {
                return Err(DatasetError::OtherManifest { folder: path.to_owned(), field: key.clone() });
            }
            Some(_) => {
                // Removed before the manifest is replaced: if the run is killed in between, they must not be mistaken
                // for its own.
                this.remove_shards()?;
                write(&file, manifest)?;
            }
        }
        Ok(this)
    }

    /// Extends a folder to a longer run. If its manifest differs from `manifest` only in a smaller number `field`, it
    /// is replaced by `manifest`. Full shards are kept; `full` returns their number for the smaller value. A partially
    /// filled shard is removed. Any other folder is left unchanged, for [`ShardFolder::open`] to check. No run with the
    /// smaller number may still be active.
    ///
    /// # Errors
    /// File system errors.
    pub fn grow(
        path: &Path,
        prefix: &str,
        manifest: &Value,
        field: &str,
        full: impl FnOnce(u64) -> usize,
    ) -> Result<(), DatasetError> {
        let file = path.join(MANIFEST);
        let Ok(Some(existing)) = read(&file, false) else { return Ok(()) };
        let (Some(before), Some(now)) = (existing[field].as_u64(), manifest[field].as_u64()) else { return Ok(()) };
        let differs = |key: &String| key != GENERATOR && existing.get(key) != manifest.get(key);
        let mut other = manifest.as_object().into_iter().flat_map(|fields| fields.keys()).filter(|key| differs(key));
        if before >= now || other.any(|key| key != field) {
            return Ok(());
        }
        // Removed before the manifest is replaced: if the run is killed in between, the folder is still that of the
        // shorter run.
        let last = path.join(shard_name(prefix, full(before)));
        match std::fs::remove_file(&last) {
            Err(error) if error.kind() != std::io::ErrorKind::NotFound => Err(DatasetError::io(&last)(error)),
            _ => write(&file, manifest),
        }
    }

    /// Returns the path of shard `number`, whether it exists or not.
    pub fn shard(&self, number: usize) -> PathBuf {
        self.path.join(shard_name(&self.prefix, number))
    }

    /// Returns the program that writes the shards, as named in the manifest.
    pub fn generator(&self) -> &str {
        &self.generator
    }

    /// Whether the shard is finished. Shards are written atomically.
    pub fn has(&self, number: usize) -> bool {
        self.shard(number).exists()
    }

    fn remove_shards(&self) -> Result<(), DatasetError> {
        let failed = || DatasetError::io(&self.path);
        for entry in std::fs::read_dir(&self.path).map_err(failed())? {
            let entry = entry.map_err(failed())?;
            let name = entry.file_name();
            let number = name.to_str().and_then(|name| {
                name.strip_prefix(&self.prefix)?.strip_prefix('-')?.strip_suffix(".tar")?.parse::<usize>().ok()
            });
            // Only names that this module writes.
            if number.is_some_and(|number| *shard_name(&self.prefix, number) == *name) {
                std::fs::remove_file(entry.path()).map_err(DatasetError::io(&entry.path()))?;
            }
        }
        Ok(())
    }
}

/// Reads the existing manifest. With `replace`, invalid JSON counts as a different manifest.
fn read(file: &Path, replace: bool) -> Result<Option<Value>, DatasetError> {
    match std::fs::read(file) {
        Ok(bytes) => match serde_json::from_slice(&bytes) {
            Ok(manifest) => Ok(Some(manifest)),
            Err(_) if replace => Ok(Some(Value::Null)),
            Err(error) => Err(DatasetError::field(file, "manifest", error)),
        },
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => Ok(None),
        Err(error) => Err(DatasetError::io(file)(error)),
    }
}

fn write(file: &Path, manifest: &Value) -> Result<(), DatasetError> {
    let text = format!("{manifest:#}");
    write_atomically(file, |out| out.write_all(text.as_bytes())).map_err(DatasetError::io(file))
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use serde_json::json;

    use super::*;

    #[test]
    fn full_shards_of_a_shorter_run_stay() {
        let folder = tempfile::tempdir().unwrap();
        let manifest = |seed: u32, scenes: u64| json!({ "seed": seed, "scenes": scenes, "generator": scenes });
        let open = |scenes| ShardFolder::open(folder.path(), "rooms", &manifest(1, scenes), false);
        let grow = |seed, scenes| {
            ShardFolder::grow(folder.path(), "rooms", &manifest(seed, scenes), "scenes", |scenes| scenes as usize / 4)
        };
        grow(1, 10).unwrap();
        assert!(!folder.path().join(MANIFEST).exists(), "there is nothing to extend");
        let shards = open(10).unwrap();
        (0..3).for_each(|number| std::fs::write(shards.shard(number), "finished").unwrap());
        // Another seed, an equal and a smaller number: everything stays.
        for (seed, scenes) in [(2, 20), (1, 10), (1, 7)] {
            grow(seed, scenes).unwrap();
            assert!(open(10).unwrap().has(2));
        }
        grow(1, 12).unwrap();
        let shards = open(12).unwrap();
        assert!(shards.has(0) && shards.has(1) && !shards.has(2), "the third shard had two rooms of four");
        assert!(open(10).is_err());
        std::fs::write(shards.shard(2), "finished").unwrap();
        grow(1, 13).unwrap();
        assert!(open(13).unwrap().has(2), "the shard was full");
    }

    #[test]
    fn finished_shards_stay_with_their_manifest_and_go_with_another() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("rooms");
        let open = |seed: u32, replace: bool| {
            ShardFolder::open(&path, "rooms", &json!({ "seed": seed, "scenes": 9, "generator": seed + 7 }), replace)
        };
        let shards = open(1, false).unwrap();
        std::fs::write(shards.shard(2), "finished").unwrap();
        for other in ["rooms-7.tar", "rooms-000002.tar.old", "letter.txt"] {
            std::fs::write(path.join(other), "not ours").unwrap();
        }
        assert!(open(1, false).unwrap().has(2) && open(1, true).unwrap().has(2));
        let refusal = open(2, false).err().unwrap();
        assert!(matches!(&refusal, DatasetError::OtherManifest { field, .. } if field == "seed"), "{refusal}");
        assert!(refusal.to_string().contains("other settings (seed differs)"), "{refusal}");
        assert!(!open(2, true).unwrap().has(2), "another seed");
        assert_eq!(std::fs::read_dir(&path).unwrap().count(), 4, "other files and the manifest stay");
        assert!(open(2, false).is_ok() && open(1, false).is_err());
    }
}
