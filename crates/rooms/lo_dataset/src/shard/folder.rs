//! Folders of shards that one or several runs fill, each going on where others stopped.

use std::io::Write;
use std::path::{Path, PathBuf};

use lo_imaging::write_atomically;
use serde_json::Value;

use super::write::shard_name;
use crate::DatasetError;

/// Says what the shards of a folder are made from.
const MANIFEST: &str = "manifest.json";

/// The field of a manifest that names the program; shards do not depend on it.
const GENERATOR: &str = "generator";

/// A folder with a manifest of what its shards are made from, and those that are finished.
#[derive(Debug)]
pub struct ShardFolder {
    path: PathBuf,
    prefix: String,
    generator: String,
}

impl ShardFolder {
    /// The name of the file that says what the shards are made from.
    pub const MANIFEST: &str = MANIFEST;

    /// Makes the folder, or takes up what an earlier run with the same `manifest` left in it.
    ///
    /// The manifest is an object of everything that the shards' bytes depend on, and `generator`: shards of two kinds must not lie side by side.
    /// With `replace` the shards of another manifest are removed.
    ///
    /// # Errors
    /// [`DatasetError::OtherManifest`] without `replace`; the file system's.
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
                // before the manifest is replaced: a run killed in between must not leave them to be taken for its own
                this.remove_shards()?;
                write(&file, manifest)?;
            }
        }
        Ok(this)
    }

    /// Makes the folder of a shorter run that of a longer one: where its manifest differs from `manifest` in nothing but a smaller number `field`, it becomes
    /// `manifest`. Shards that were full stay, `full` says how many those are by the smaller number; one that was not is removed. Any other folder stays
    /// as it is, for [`ShardFolder::open`] to judge. No run with the smaller number may still go on.
    ///
    /// # Errors
    /// The file system's.
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
        // before the manifest is replaced: a run killed in between leaves a folder of the shorter run
        let last = path.join(shard_name(prefix, full(before)));
        match std::fs::remove_file(&last) {
            Err(error) if error.kind() != std::io::ErrorKind::NotFound => Err(DatasetError::io(&last)(error)),
            _ => write(&file, manifest),
        }
    }

    /// Where shard `number` lies or will lie.
    pub fn shard(&self, number: usize) -> PathBuf {
        self.path.join(shard_name(&self.prefix, number))
    }

    /// The program that writes the shards, as the manifest names it.
    pub fn generator(&self) -> &str {
        &self.generator
    }

    /// Whether it is finished: a shard appears whole or not at all.
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
            // only names that are written here
            if number.is_some_and(|number| *shard_name(&self.prefix, number) == *name) {
                std::fs::remove_file(entry.path()).map_err(DatasetError::io(&entry.path()))?;
            }
        }
        Ok(())
    }
}

/// The manifest that is there; with `replace`, one that is no JSON counts as another one.
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
        assert!(!folder.path().join(MANIFEST).exists(), "nothing is there to grow");
        let shards = open(10).unwrap();
        (0..3).for_each(|number| std::fs::write(shards.shard(number), "finished").unwrap());
        // Of another seed, as many and fewer: all stays.
        for (seed, scenes) in [(2, 20), (1, 10), (1, 7)] {
            grow(seed, scenes).unwrap();
            assert!(open(10).unwrap().has(2));
        }
        grow(1, 12).unwrap();
        let shards = open(12).unwrap();
        assert!(shards.has(0) && shards.has(1) && !shards.has(2), "the third had two rooms of four");
        assert!(open(10).is_err());
        std::fs::write(shards.shard(2), "finished").unwrap();
        grow(1, 13).unwrap();
        assert!(open(13).unwrap().has(2), "it was full");
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
        assert!(refusal.to_string().contains("another seed"), "{refusal}");
        assert!(!open(2, true).unwrap().has(2), "of another seed");
        assert_eq!(std::fs::read_dir(&path).unwrap().count(), 4, "what is not ours stays, beside the manifest");
        assert!(open(2, false).is_ok() && open(1, false).is_err());
    }
}
