//! Memory of uploads: files that are being received or read, files that wait for others, and meshes of the session.

use std::collections::HashMap;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// Maximum size of one file, bytes.
pub(crate) const MAX_UPLOAD: usize = 256 << 20;

/// Maximum size of all files together, bytes.
pub(crate) const MAX_UPLOADS: usize = 1 << 30;

/// Maximum number of files that wait for others.
const MAX_WAITING_FILES: usize = 64;

/// All uploaded files in memory.
#[derive(Default)]
pub(crate) struct Uploads {
    files: Mutex<UploadedFiles>,
    /// Locked while a mesh is read, which may take a multiple of its size.
    pub reading: tokio::sync::Mutex<()>,
}

#[derive(Default)]
struct UploadedFiles {
    /// Bytes of all [`Reservation`]s.
    reserved: usize,
    /// Files that wait for the mesh or photo that they belong to.
    waiting: HashMap<String, Vec<u8>>,
    /// Bytes of the session's meshes.
    meshes: usize,
}

/// The files together exceed [`MAX_UPLOADS`] or the number of waiting files.
#[derive(Debug, PartialEq, thiserror::Error)]
#[error("too many uploaded files: at most 1 GB in total, and 64 files that belong to one mesh or photo")]
pub(crate) struct TooManyUploads;

impl Uploads {
    fn lock(&self) -> MutexGuard<'_, UploadedFiles> {
        self.files.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Starts counting the bytes of a file.
    pub fn reserve(self: &Arc<Self>) -> Reservation {
        Reservation { uploads: self.clone(), bytes: 0 }
    }

    /// Keeps a file until the one that it belongs to arrives, replacing one of the same name.
    ///
    /// # Errors
    /// If there are too many waiting files. All of them are dropped then, because nobody may ever need them.
    pub fn keep(&self, name: String, bytes: Vec<u8>) -> Result<(), TooManyUploads> {
        let mut files = self.lock();
        files.waiting.remove(&name);
        files.waiting.insert(name, bytes);
        if files.waiting.len() > MAX_WAITING_FILES {
            files.waiting.clear();
            return Err(TooManyUploads);
        }
        Ok(())
    }

    /// Sets the size of the session's meshes.
    pub fn set_meshes(&self, bytes: usize) {
        self.lock().meshes = bytes;
    }
}

/// Bytes of a file that is being received or read. They are released on drop.
pub(crate) struct Reservation {
    uploads: Arc<Uploads>,
    bytes: usize,
}

impl Reservation {
    /// Adds received bytes.
    ///
    /// # Errors
    /// If the files together are too large. Waiting files are dropped then, because nobody may ever need them.
    pub fn add(&mut self, bytes: usize) -> Result<(), TooManyUploads> {
        let mut files = self.uploads.lock();
        let waiting: usize = files.waiting.values().map(Vec::len).sum();
        if files.reserved + files.meshes + waiting + bytes > MAX_UPLOADS {
            files.waiting.clear();
            return Err(TooManyUploads);
        }
        files.reserved += bytes;
        self.bytes += bytes;
        Ok(())
    }

    /// Takes all waiting files and counts their bytes.
    pub fn take_waiting(&mut self) -> HashMap<String, Vec<u8>> {
        let mut files = self.uploads.lock();
        let waiting = std::mem::take(&mut files.waiting);
        let bytes: usize = waiting.values().map(Vec::len).sum();
        files.reserved += bytes;
        self.bytes += bytes;
        waiting
    }
}

impl Drop for Reservation {
    fn drop(&mut self) {
        self.uploads.lock().reserved -= self.bytes;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_together_are_bounded() {
        let uploads = Arc::new(Uploads::default());
        let mut all: Vec<Reservation> = (0..4).map(|_| uploads.reserve()).collect();
        assert!(all.iter_mut().all(|one| one.add(MAX_UPLOAD).is_ok()));
        let mut late = uploads.reserve();
        assert_eq!(late.add(1), Err(TooManyUploads));
        all.pop();
        assert_eq!(late.add(MAX_UPLOAD), Ok(()));
        drop((all, late));
        // Meshes of the session and waiting files count, too. The latter are dropped.
        uploads.set_meshes(MAX_UPLOADS - 10);
        assert_eq!(uploads.keep("a.mtl".into(), vec![0; 6]), Ok(()));
        let mut part = uploads.reserve();
        assert_eq!((part.add(4), part.add(1)), (Ok(()), Err(TooManyUploads)));
        assert!(part.take_waiting().is_empty());
        // Waiting files count while the file that they belong to is read.
        assert_eq!(uploads.keep("b.mtl".into(), vec![0; 6]), Ok(()));
        assert_eq!((part.take_waiting().len(), part.add(1)), (1, Err(TooManyUploads)));
        for index in 0..MAX_WAITING_FILES {
            assert_eq!(uploads.keep(index.to_string(), Vec::new()), Ok(()));
        }
        assert_eq!(uploads.keep("0".into(), vec![1]), Ok(()));
        assert_eq!(uploads.keep("one more".into(), Vec::new()), Err(TooManyUploads));
    }
}
