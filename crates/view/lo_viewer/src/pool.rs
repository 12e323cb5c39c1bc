use std::collections::HashMap;

/// Most bytes of one file.
pub(crate) const MAX_UPLOAD: usize = 256 << 20;

/// Most bytes of all files that wait for the one that names them.
const MAX_POOL: usize = 512 << 20;

/// Most of these files.
const MAX_POOL_FILES: usize = 64;

/// Files that wait for the one that names them.
#[derive(Default)]
pub(crate) struct Pool {
    pub files: HashMap<String, Vec<u8>>,
}

impl Pool {
    /// Keeps a file, in place of one of the same name.
    pub fn put(&mut self, name: String, bytes: Vec<u8>) -> Result<(), &'static str> {
        self.files.remove(&name);
        let held: usize = self.files.values().map(Vec::len).sum();
        if self.files.len() >= MAX_POOL_FILES || held + bytes.len() > MAX_POOL {
            self.files.clear();
            return Err("too many files for one object: at most 64 files of 512 MB in all");
        }
        self.files.insert(name, bytes);
        Ok(())
    }
}
