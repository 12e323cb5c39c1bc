//! A sequence as video: YUV4MPEG2, uncompressed, which every encoder reads from a file or a pipe.

use std::io::{self, Write};
use std::path::{Path, PathBuf};

use anyhow::Context;
use lightoctree::imaging::{Photo, srgb8_from_linear};
use tempfile::NamedTempFile;
use y4m::{Colorspace, Encoder, Frame, Ratio};

/// The name that stands for standard output.
const STDOUT: &str = "-";

/// Frames of one size, written one by one.
pub struct Video {
    encoder: Encoder<Box<dyn Write>>,
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
        let rate = Ratio::new(frames_per_second as usize, 1);
        let encoder = y4m::encode(size.0, size.1, rate).with_colorspace(Colorspace::C444).write_header(target);
        Ok(Self { encoder: encoder.context("cannot write the video's header")?, file })
    }

    /// Adds a frame.
    ///
    /// # Errors
    /// Where it cannot be written.
    pub fn add(&mut self, photo: &Photo) -> anyhow::Result<()> {
        let codes: Vec<[u8; 3]> = match photo {
            Photo::Srgb8(image) => image.pixels().to_vec(),
            Photo::Linear(image) => image.pixels().iter().map(|pixel| pixel.map(srgb8_from_linear)).collect(),
        };
        let mut planes = [(); 3].map(|()| Vec::with_capacity(codes.len()));
        for rgb in codes {
            for (plane, value) in planes.iter_mut().zip(y_cb_cr(rgb)) {
                plane.push(value);
            }
        }
        let [y, cb, cr] = &planes;
        self.encoder.write_frame(&Frame::new([y, cb, cr], None)).context("cannot write a frame of the video")
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

/// R'G'B' to Y'CbCr of ITU-R BT.709 in narrow range: 16 to 235 and 16 to 240.
fn y_cb_cr(rgb: [u8; 3]) -> [u8; 3] {
    let [r, g, b] = rgb.map(|code| f32::from(code) / 255.0);
    let y = 0.2126 * r + 0.7152 * g + 0.0722 * b;
    let (cb, cr) = ((b - y) / 1.8556, (r - y) / 1.5748);
    [16.0 + 219.0 * y, 128.0 + 224.0 * cb, 128.0 + 224.0 * cr].map(|value| value.round() as u8)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn colours_are_those_of_bt_709() {
        // Colour bars of 100 % as tables of ITU-R BT.709 have them at 8 bits.
        let bars = [
            ([255, 255, 255], [235, 128, 128]),
            ([0, 0, 0], [16, 128, 128]),
            ([255, 0, 0], [63, 102, 240]),
            ([0, 255, 0], [173, 42, 26]),
            ([0, 0, 255], [32, 240, 118]),
            ([255, 255, 0], [219, 16, 138]),
        ];
        for (rgb, expected) in bars {
            assert_eq!(y_cb_cr(rgb), expected, "{rgb:?}");
        }
    }
}
