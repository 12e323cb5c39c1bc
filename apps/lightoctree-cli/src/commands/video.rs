//! Writes a sequence as an uncompressed YUV4MPEG2 video, which encoders read from a file or a pipe.

use std::io::{self, Write};
use std::path::{Path, PathBuf};

use anyhow::Context;
use lo_imaging::{Photo, Y4mWriter};
use tempfile::NamedTempFile;

/// File name of standard output.
const STDOUT: &str = "-";

/// A video that is written frame by frame.
pub struct Video {
    writer: Y4mWriter<Box<dyn Write>>,
    /// The temporary file and its final path; `None` for standard output.
    file: Option<(NamedTempFile, PathBuf)>,
}

impl Video {
    /// Whether an output path selects a video: `-` or `*.y4m`.
    pub fn is_video(output: &Path) -> bool {
        is_stdout(output) || output.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("y4m"))
    }

    /// Starts a video with frames of `size` pixels. The file appears when the video is finished.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn create(output: &Path, size: (usize, usize), frames_per_second: u32) -> anyhow::Result<Self> {
        let (target, file): (Box<dyn Write>, _) = if is_stdout(output) {
            (Box::new(io::stdout()), None)
        } else {
            let made = lo_imaging::temporary_beside(output).and_then(|file| Ok((file.as_file().try_clone()?, file)));
            let (handle, file) = made.with_context(|| format!("cannot write {}", output.display()))?;
            (Box::new(handle), Some((file, output.to_owned())))
        };
        let writer = Y4mWriter::new(target, size, frames_per_second).context("cannot write the video's header")?;
        Ok(Self { writer, file })
    }

    /// Writes a frame.
    ///
    /// # Errors
    /// The frame cannot be written.
    pub fn add(&mut self, photo: &Photo) -> anyhow::Result<()> {
        self.writer.add(photo).context("cannot write a frame of the video")
    }

    /// Flushes the output and moves the file to its final path.
    ///
    /// # Errors
    /// The file cannot be written.
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

/// Whether an output path is standard output.
pub fn is_stdout(output: &Path) -> bool {
    output == Path::new(STDOUT)
}
