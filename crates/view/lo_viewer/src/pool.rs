use std::collections::HashMap;

/// Maximum size of one file, bytes.
pub(crate) const MAX_UPLOAD: usize = 256 << 20;

/// Maximum size of all held files, bytes.
const MAX_POOL: usize = 512 << 20;

/// Maximum number of held files.
const MAX_POOL_FILES: usize = 64;

/// Uploaded files held until the file that references them arrives.
#[derive(Default)]
pub(crate) struct Pool {
    pub files: HashMap<String, Vec<u8>>,
}

impl Pool {
    /// Holds a file, replacing one of the same name.
    pub fn put(&mut self, name: String, bytes: Vec<u8>) -> Result<(), &'static str> {
        self.files.remove(&name);
        let held: usize = self.files.values().map(Vec::len).sum();
        if self.files.len() >= MAX_POOL_FILES || held + bytes.len() > MAX_POOL {
            self.files.clear();
            return Err("too many files for one upload: at most 64 files with 512 MB in total");
        }
        self.files.insert(name, bytes);
        Ok(())
    }
}
