//! Locations of the members of a tar archive, from its headers alone.

use std::collections::HashMap;
use std::fs::File;
use std::io::{BufReader, Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};

use crate::DatasetError;

/// One archive.
#[derive(Debug)]
pub(super) struct ShardIndex {
    pub path: PathBuf,
    /// Records in the archive's order.
    pub records: Vec<RecordIndex>,
}

/// Members that share a key.
#[derive(Debug)]
pub(super) struct RecordIndex {
    /// Member name up to the first dot of its last path component.
    pub key: String,
    /// Suffix after that dot → location in the archive.
    pub members: HashMap<String, Span>,
}

/// Byte range of an archive.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Span {
    pub offset: u64,
    pub length: u64,
}

impl ShardIndex {
    /// Reads the headers of all members. Members that are not regular files, damaged headers, and members that extend
    /// beyond the end of the file are errors.
    pub fn read(path: &Path) -> Result<Self, DatasetError> {
        let file = File::open(path).map_err(DatasetError::io(path))?;
        let length = file.metadata().map_err(DatasetError::io(path))?.len();
        let damaged = |reason: String| DatasetError::Shard { shard: path.to_owned(), reason };
        let mut archive = tar::Archive::new(BufReader::with_capacity(512, file));
        let entries = archive.entries_with_seek().map_err(|error| damaged(error.to_string()))?;
        let mut records: Vec<RecordIndex> = Vec::new();
        let mut numbers: HashMap<String, usize> = HashMap::new();
        for entry in entries {
            let entry = entry.map_err(|error| damaged(format!("not a tar archive, or damaged: {error}")))?;
            let kind = entry.header().entry_type();
            if kind.is_dir() || kind.is_pax_global_extensions() {
                continue;
            }
            let name = entry.path_bytes();
            let name = std::str::from_utf8(&name).map_err(|_| damaged("a member's name is not UTF-8".to_owned()))?;
            if !kind.is_file() {
                return Err(damaged(format!("member {name} is not a regular file")));
            }
            let span = Span { offset: entry.raw_file_position(), length: entry.size() };
            if span.offset.checked_add(span.length).is_none_or(|end| end > length) {
                return Err(damaged(format!("the archive ends within member {name}")));
            }
            let file = name.rsplit('/').next().unwrap_or(name);
            let (stem, rest) = file.split_once('.').unwrap_or((file, ""));
            let key = format!("{}{stem}", &name[..name.len() - file.len()]);
            let number = *numbers.entry(key.clone()).or_insert_with(|| {
                records.push(RecordIndex { key, members: HashMap::new() });
                records.len() - 1
            });
            if records[number].members.insert(rest.to_owned(), span).is_some() {
                return Err(damaged(format!("duplicate member {name}")));
            }
        }
        Ok(Self { path: path.to_owned(), records })
    }

    /// Reads the bytes of a member.
    pub fn bytes(&self, span: Span) -> Result<Vec<u8>, DatasetError> {
        let mut file = File::open(&self.path).map_err(DatasetError::io(&self.path))?;
        file.seek(SeekFrom::Start(span.offset)).map_err(DatasetError::io(&self.path))?;
        let mut bytes = Vec::new();
        file.take(span.length).read_to_end(&mut bytes).map_err(DatasetError::io(&self.path))?;
        if bytes.len() as u64 != span.length {
            let reason = "the archive was truncated while in use".to_owned();
            return Err(DatasetError::Shard { shard: self.path.clone(), reason });
        }
        Ok(bytes)
    }
}
