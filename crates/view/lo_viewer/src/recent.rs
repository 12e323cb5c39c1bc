//! Recently opened rooms with all changes, in a folder: the autosaved scene, a preview, and a description of each.

use std::fs;
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::time::{SystemTime, UNIX_EPOCH};

use serde::{Deserialize, Serialize};

/// Maximum number of rooms, and of bytes of their scenes. The oldest are dropped.
const MAX_ROOMS: usize = 12;
const MAX_BYTES: u64 = 2 << 30;

/// Description of a room.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "typescript", derive(ts_rs::TS))]
#[serde(deny_unknown_fields)]
pub struct RecentRoom {
    /// Unique name, 16 hexadecimal digits.
    pub id: String,
    /// Path of the scene file on the command line.
    pub file: String,
    /// Whether that file exists.
    pub has_file: bool,
    /// Whether the room has changes that this file has not.
    pub unsaved: bool,
    /// Number of objects.
    pub objects: usize,
    /// Time of the last change, seconds since 1970.
    pub changed_s: u64,
}

/// The folder.
#[derive(Clone, Debug)]
pub(crate) struct RecentRooms {
    folder: PathBuf,
}

impl RecentRooms {
    /// Uses a folder, which need not exist yet.
    pub fn new(folder: PathBuf) -> Self {
        Self { folder }
    }

    /// Returns the rooms, those changed last first. Unreadable files are ignored.
    pub fn list(&self) -> Vec<RecentRoom> {
        let entries = fs::read_dir(&self.folder).into_iter().flatten().flatten();
        let descriptions =
            entries.map(|entry| entry.path()).filter(|path| path.extension().is_some_and(|e| e == "json"));
        let room = |path: PathBuf| {
            let room: RecentRoom = serde_json::from_slice(&fs::read(path).ok()?).ok()?;
            (is_id(&room.id) && self.path(&room.id, "scene").is_file()).then_some(room)
        };
        let mut rooms: Vec<RecentRoom> = descriptions.filter_map(room).collect();
        rooms.sort_by(|a, b| b.changed_s.cmp(&a.changed_s).then_with(|| a.id.cmp(&b.id)));
        rooms
    }

    /// Returns a room; `None` if there is none of this id.
    pub fn room(&self, id: &str) -> Option<RecentRoom> {
        self.list().into_iter().find(|room| room.id == id)
    }

    /// Reads the scene of a room.
    ///
    /// # Errors
    /// If it cannot be read.
    pub fn scene(&self, room: &RecentRoom) -> io::Result<Vec<u8>> {
        fs::read(self.path(&room.id, "scene"))
    }

    /// Reads the preview of a room, a JPEG.
    ///
    /// # Errors
    /// If it cannot be read.
    pub fn preview(&self, room: &RecentRoom) -> io::Result<Vec<u8>> {
        fs::read(self.path(&room.id, "jpg"))
    }

    /// Writes a room, which replaces one of the same id, and those without changes of the same file. Drops the oldest
    /// rooms beyond the limits.
    ///
    /// # Errors
    /// If a file cannot be written. A room that was there before stays then.
    pub fn write(&self, room: &RecentRoom, scene: &[u8], preview: &[u8]) -> io::Result<()> {
        create_private_folder(&self.folder)?;
        let description = serde_json::to_vec(room)?;
        // The description last: without it, the others are not listed.
        for (ending, bytes) in [("scene", scene), ("jpg", preview), ("json", &description)] {
            replace(&self.path(&room.id, ending), bytes)?;
        }
        let is_copy = |other: &RecentRoom| other.id != room.id && other.file == room.file && other.has_file;
        let mut bytes = 0;
        for (index, other) in self.list().into_iter().enumerate() {
            bytes += fs::metadata(self.path(&other.id, "scene")).map_or(0, |metadata| metadata.len());
            let is_beyond = index >= MAX_ROOMS || bytes > MAX_BYTES;
            if (is_beyond && other.id != room.id) || (is_copy(&other) && !other.unsaved) {
                self.remove(&other);
            }
        }
        Ok(())
    }

    /// Removes a room.
    pub fn remove(&self, room: &RecentRoom) {
        for ending in ["json", "scene", "jpg"] {
            // Another viewer may have removed it.
            let _ = fs::remove_file(self.path(&room.id, ending));
        }
    }

    fn path(&self, id: &str, ending: &str) -> PathBuf {
        self.folder.join(format!("{id}.{ending}"))
    }
}

/// Returns seconds since 1970.
pub(crate) fn now_s() -> u64 {
    SystemTime::now().duration_since(UNIX_EPOCH).map_or(0, |since| since.as_secs())
}

/// Returns whether a text may be the id of a room, and so part of a path.
fn is_id(text: &str) -> bool {
    text.len() == 16 && text.bytes().all(|c| c.is_ascii_digit() || (b'a'..=b'f').contains(&c))
}

/// Creates a folder that only its owner can read.
fn create_private_folder(folder: &Path) -> io::Result<()> {
    let mut builder = fs::DirBuilder::new();
    builder.recursive(true);
    #[cfg(unix)]
    std::os::unix::fs::DirBuilderExt::mode(&mut builder, 0o700);
    builder.create(folder)
}

/// Replaces a file by a new one that only its owner can read, all at once.
fn replace(path: &Path, bytes: &[u8]) -> io::Result<()> {
    let new =
        path.with_extension(format!("{}.{}.new", path.extension().unwrap_or_default().display(), std::process::id()));
    let mut options = fs::OpenOptions::new();
    options.write(true).create(true).truncate(true);
    #[cfg(unix)]
    std::os::unix::fs::OpenOptionsExt::mode(&mut options, 0o600);
    let written = options.open(&new).and_then(|mut file| file.write_all(bytes)).and_then(|()| fs::rename(&new, path));
    if written.is_err() {
        let _ = fs::remove_file(&new);
    }
    written
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    fn room(number: u64, file: &str) -> RecentRoom {
        let id = format!("{number:016x}");
        RecentRoom { id, file: file.into(), has_file: true, unsaved: true, objects: 1, changed_s: number }
    }

    fn ids(rooms: &RecentRooms) -> Vec<u64> {
        rooms.list().iter().map(|room| room.changed_s).collect()
    }

    #[test]
    fn rooms_are_listed_newest_first_and_the_oldest_are_dropped() {
        let folder = tempfile::tempdir().unwrap();
        let rooms = RecentRooms::new(folder.path().join("a/b"));
        assert!(rooms.list().is_empty());
        for number in 1..=14 {
            rooms.write(&room(number, "a.scene"), b"scene", b"preview").unwrap();
        }
        assert_eq!(ids(&rooms), (3..=14).rev().collect::<Vec<_>>());
        let newest = rooms.room(&room(14, "").id).unwrap();
        assert_eq!(
            (rooms.scene(&newest).unwrap(), rooms.preview(&newest).unwrap()),
            (b"scene".into(), b"preview".into())
        );
        rooms.remove(&newest);
        assert_eq!(rooms.room(&newest.id), None);
        assert_eq!(fs::read_dir(folder.path().join("a/b")).unwrap().count(), 3 * 11);
    }

    #[test]
    fn a_copy_without_changes_is_replaced_and_others_stay() {
        let folder = tempfile::tempdir().unwrap();
        let rooms = RecentRooms::new(folder.path().to_owned());
        let unchanged = RecentRoom { unsaved: false, ..room(1, "a.scene") };
        for room in [&unchanged, &room(2, "a.scene"), &room(3, "b.scene"), &room(4, "a.scene")] {
            rooms.write(room, b"", b"").unwrap();
        }
        assert_eq!(ids(&rooms), [4, 3, 2]);
    }

    #[test]
    fn foreign_and_damaged_files_are_ignored() {
        let folder = tempfile::tempdir().unwrap();
        let rooms = RecentRooms::new(folder.path().to_owned());
        rooms.write(&room(1, "a.scene"), b"", b"").unwrap();
        fs::write(folder.path().join("x.json"), b"{").unwrap();
        let elsewhere = RecentRoom { id: "../../../etc/pass".into(), ..room(2, "") };
        fs::write(folder.path().join("y.json"), serde_json::to_vec(&elsewhere).unwrap()).unwrap();
        let without_scene = serde_json::to_vec(&room(3, "")).unwrap();
        fs::write(folder.path().join("z.json"), without_scene).unwrap();
        assert_eq!(ids(&rooms), [1]);
    }

    #[cfg(unix)]
    #[test]
    fn only_the_owner_can_read_them() {
        use std::os::unix::fs::PermissionsExt;
        let folder = tempfile::tempdir().unwrap();
        let rooms = RecentRooms::new(folder.path().join("rooms"));
        rooms.write(&room(1, "a.scene"), b"", b"").unwrap();
        let mode = |path: &Path| fs::metadata(path).unwrap().permissions().mode() & 0o777;
        assert_eq!(mode(&folder.path().join("rooms")), 0o700);
        assert_eq!(mode(&rooms.path(&room(1, "").id, "scene")), 0o600);
    }
}
