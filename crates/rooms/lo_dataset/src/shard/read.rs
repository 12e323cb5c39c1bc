use std::borrow::Cow;
use std::path::{Path, PathBuf};

use serde::Deserialize;

use super::index::{RecordIndex, ShardIndex};
use super::pack::{HEADER, MemberError, header, unpack};
use crate::{Dataset, DatasetError, Sample, Split};

/// All shards of a folder, with random access.
///
/// Opening reads only the tar headers of every archive and the small JSON header of every record.
#[derive(Debug)]
pub struct Shards {
    shards: Vec<ShardIndex>,
    samples: Vec<ShotIndex>,
    scenes: Vec<Scene>,
}

/// The room of a record.
#[derive(Debug)]
struct Scene {
    id: String,
    /// The split in the metadata, which converted datasets with a published split have.
    split: Option<Split>,
}

/// Location of a sample.
#[derive(Clone, Copy, Debug)]
struct ShotIndex {
    shard: u32,
    record: u32,
    shot: u32,
    scene: u32,
}

impl Shards {
    /// Opens every `.tar` of a folder, in the order of their names, or a single archive.
    ///
    /// # Errors
    /// If the folder has no archives, an archive is not a tar or is truncated, or a record's header is missing, damaged
    /// or of another version.
    pub fn open(path: &Path) -> Result<Self, DatasetError> {
        let paths = if path.is_dir() { archives(path)? } else { vec![path.to_owned()] };
        if paths.is_empty() {
            return Err(DatasetError::layout(path, "contains no .tar archive"));
        }
        let mut this = Self { shards: Vec::new(), samples: Vec::new(), scenes: Vec::new() };
        for path in paths {
            this.add(ShardIndex::read(&path)?)?;
        }
        Ok(this)
    }

    fn add(&mut self, shard: ShardIndex) -> Result<(), DatasetError> {
        for (number, record) in shard.records.iter().enumerate() {
            let bytes = member(&shard, record, HEADER).map_err(|error| located(&shard, record, error))?;
            let header = header(&bytes).map_err(|error| located(&shard, record, error))?;
            let scene = self.scenes.len() as u32;
            let metadata = header.shots.first().map(|shot| &shot.metadata);
            let split = metadata.and_then(|metadata| Split::deserialize(metadata.get(Split::KEY)?).ok());
            self.scenes.push(Scene { id: header.scene_id, split });
            self.samples.extend((0..header.shots.len()).map(|shot| ShotIndex {
                shard: self.shards.len() as u32,
                record: number as u32,
                shot: shot as u32,
                scene,
            }));
        }
        self.shards.push(shard);
        Ok(())
    }
}

impl Dataset for Shards {
    fn len(&self) -> usize {
        self.samples.len()
    }

    fn scene_id(&self, index: usize) -> Cow<'_, str> {
        self.scenes[self.samples[index].scene as usize].id.as_str().into()
    }

    fn split(&self, index: usize) -> Split {
        let Scene { id, split } = &self.scenes[self.samples[index].scene as usize];
        split.unwrap_or_else(|| Split::of(id))
    }

    fn get(&self, index: usize) -> Result<Sample, DatasetError> {
        let place = *self.samples.get(index).ok_or(DatasetError::Index { index, len: self.samples.len() })?;
        let shard = &self.shards[place.shard as usize];
        let record = &shard.records[place.record as usize];
        let (shots, sample) = read_shot(shard, record, place.shot as usize).map_err(|p| located(shard, record, p))?;
        let id = if shots == 1 { record.key.clone() } else { format!("{}-{}", record.key, place.shot) };
        Ok(Sample { id, ..sample })
    }
}

/// Reads a photo's sample. Also returns the record's number of photos.
fn read_shot(shard: &ShardIndex, record: &RecordIndex, shot: usize) -> Result<(usize, Sample), MemberError> {
    let header = header(&member(shard, record, HEADER)?)?;
    if shot >= header.shots.len() {
        return Err(MemberError::new(HEADER, "shots", "fewer than when the archive was opened"));
    }
    let read = |file: &str| member(shard, record, file);
    Ok((header.shots.len(), unpack(&record.key, &header, shot, &read)?.into_sample()))
}

fn member(shard: &ShardIndex, record: &RecordIndex, file: &str) -> Result<Vec<u8>, MemberError> {
    let span = record.members.get(file).ok_or_else(|| MemberError::new(file, "file", "missing from the archive"))?;
    shard.bytes(*span).map_err(|error| MemberError::new(file, "file", error))
}

fn located(shard: &ShardIndex, record: &RecordIndex, error: MemberError) -> DatasetError {
    DatasetError::Member {
        shard: shard.path.clone(),
        member: format!("{}.{}", record.key, error.file),
        field: error.field,
        reason: error.reason,
    }
}

fn archives(folder: &Path) -> Result<Vec<PathBuf>, DatasetError> {
    let mut paths = Vec::new();
    for entry in std::fs::read_dir(folder).map_err(DatasetError::io(folder))? {
        let path = entry.map_err(DatasetError::io(folder))?.path();
        if path.extension().is_some_and(|extension| extension == "tar") {
            paths.push(path);
        }
    }
    paths.sort();
    Ok(paths)
}
