//! ZIP archives without compression: images are compressed already.

use std::io::{self, Write};

use zip::write::{SimpleFileOptions, StreamWriter};
use zip::{CompressionMethod, DateTime, ZipWriter};

/// Writes an archive from front to back.
pub(crate) struct ZipArchive<W: Write>(ZipWriter<StreamWriter<W>>);

impl<W: Write> ZipArchive<W> {
    /// Begins an archive.
    pub fn new(target: W) -> Self {
        Self(ZipWriter::new_stream(target))
    }

    /// Appends a file. Equal files give equal bytes.
    pub fn add(&mut self, name: &str, content: &[u8]) -> io::Result<()> {
        let options = SimpleFileOptions::default()
            .compression_method(CompressionMethod::Stored)
            .last_modified_time(DateTime::default());
        self.0.start_file(name, options)?;
        self.0.write_all(content)
    }

    /// Ends the archive and returns the target.
    pub fn finish(self) -> io::Result<W> {
        Ok(self.0.finish()?.into_inner())
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use std::io::{Cursor, Read};

    use super::*;

    #[test]
    fn files_come_back() {
        let mut archive = ZipArchive::new(Vec::new());
        let large = vec![7; 100_000];
        for (name, content) in [("a/b.png", &b"one"[..]), ("c.exr", &large), ("empty", b"")] {
            archive.add(name, content).unwrap();
        }
        let mut read = zip::ZipArchive::new(Cursor::new(archive.finish().unwrap())).unwrap();
        let names: Vec<String> = read.file_names().map(|name| name.unwrap().into_owned()).collect();
        assert_eq!(names, ["a/b.png", "c.exr", "empty"]);
        let mut content = Vec::new();
        read.by_name("c.exr").unwrap().read_to_end(&mut content).unwrap();
        assert!(content == large);
    }
}
