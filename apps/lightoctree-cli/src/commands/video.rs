//! A sequence as video: YUV4MPEG2, uncompressed, which every encoder reads from a file or a pipe.

use std::io::{self, Write};
use std::path::{Path, PathBuf};

use anyhow::Context;
use lightoctree::imaging::{Photo, Y4mWriter};
use tempfile::NamedTempFile;

/// The name that stands for standard output.
const STDOUT: &str = "-";

/// Frames of one size, written one by one.
pub struct Video {
    writer: Y4mWriter<Box<dyn Write>>,
    /// The file under another name, and where it goes at the end; nothing for standard output.
    file: Option<(NamedTempFile, PathBuf)>,
}

impl Video {
    /// Whether a name asks for a video: `-` or `*.y4m`.
    pub fn is_asked(output: &Path) -> bool {
        is_stdout(output) || output.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("y4m"))
    }

    /// Begins a video of `size` pixels. A file appears when it is finished.
    ///
    /// # Errors
    /// Where nothing can be written.
    pub fn create(output: &Path, size: (usize, usize), frames_per_second: u32) -> anyhow::Result<Self> {
        let (target, file): (Box<dyn Write>, _) = if is_stdout(output) {
            (Box::new(io::stdout()), None)
        } else {
            let folder = output.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
            let made = NamedTempFile::new_in(folder).and_then(|file| Ok((file.as_file().try_clone()?, file)));
            let (handle, file) = made.with_context(|| format!("cannot write {}", output.display()))?;
            (Box::new(handle), Some((file, output.to_owned())))
        };
        let writer = Y4mWriter::new(target, size, frames_per_second).context("cannot write the video's header")?;
        Ok(Self { writer, file })
    }

    /// Adds a frame.
    ///
    /// # Errors
    /// Where it cannot be written.
    pub fn add(&mut self, photo: &Photo) -> anyhow::Result<()> {
        self.writer.add(photo).context("cannot write a frame of the video")
    }

    /// Writes what is left, and gives the file its name.
    ///
    /// # Errors
    /// Where it cannot be written.
    pub fn finish(self) -> anyhow::Result<()> {
        match self.file {
            Some((file, path)) => {
                file.persist(&path).with_context(|| format!("cannot write {}", path.display()))?;
            }
            None => io::stdout().flush().context("cannot write the video")?,
        }
        Ok(())
    }
}

/// Whether a name stands for standard output.
pub fn is_stdout(output: &Path) -> bool {
    output == Path::new(STDOUT)
}
