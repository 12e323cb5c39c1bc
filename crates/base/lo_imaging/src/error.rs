use std::path::{Path, PathBuf};

use crate::Format;

/// What went wrong with an image; every message names the file (or the name given with the bytes) and the format.
#[derive(Debug, thiserror::Error)]
pub enum ImageError {
    /// The file cannot be opened, read or written.
    #[error("{}: {source}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// What the operating system says.
        source: std::io::Error,
    },
    /// Neither the first bytes nor the extension tell what the file is.
    #[error("{name}: not a format that can be read here; expected {expected}")]
    UnknownFormat {
        /// Path or name.
        name: String,
        /// What would be read.
        expected: &'static str,
    },
    /// The bytes are not a valid file of their format.
    #[error("{name}: damaged or invalid {format}: {reason}")]
    Invalid {
        /// Path or name.
        name: String,
        /// Format found.
        format: Format,
        /// What is wrong.
        reason: String,
    },
    /// The file is valid as far as can be seen, but uses something that is not read here.
    #[error("{name}: this {format} uses {feature}, which cannot be read")]
    Unsupported {
        /// Path or name.
        name: String,
        /// Format found.
        format: Format,
        /// The compression, pixel type or layout.
        feature: String,
    },
    /// The declared size exceeds the limits of this crate or what the bytes can hold.
    #[error("{name}: this {format} declares {width} × {height} pixels, {limit}")]
    TooLarge {
        /// Path or name.
        name: String,
        /// Format found.
        format: Format,
        /// Declared width in pixels.
        width: u64,
        /// Declared height in pixels.
        height: u64,
        /// The limit that is broken.
        limit: String,
    },
    /// The extension of an output file names no format that can hold the picture.
    #[error("{}: cannot write this as “.{}”; use one of {supported}", path.display(), extension(path))]
    OutputFormat {
        /// The file.
        path: PathBuf,
        /// Extensions that would work.
        supported: &'static str,
    },
    /// The picture cannot be held by the output format.
    #[error("{}: {format} cannot hold this picture: {reason}", path.display())]
    Encode {
        /// The file.
        path: PathBuf,
        /// Format of the file.
        format: Format,
        /// What is wrong.
        reason: String,
    },
}

fn extension(path: &Path) -> String {
    path.extension().unwrap_or_default().to_string_lossy().into_owned()
}
