use std::path::{Path, PathBuf};

use crate::Format;

/// Errors of reading and writing images. Every message names the file (or the name given with the bytes).
#[derive(Debug, thiserror::Error)]
pub enum ImageError {
    /// The file could not be opened, read or written.
    #[error("{}: {source}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// Error of the operating system.
        source: std::io::Error,
    },
    /// Neither the first bytes nor the extension identify a format.
    #[error("{name}: unrecognised image format; expected {expected}")]
    UnknownFormat {
        /// Path or name.
        name: String,
        /// Formats that can be read.
        expected: &'static str,
    },
    /// The format is recognised, but not read.
    #[error("{name}: {format} files are not read; {way_out}")]
    NotRead {
        /// Path or name.
        name: String,
        /// Detected format.
        format: &'static str,
        /// How to convert the file.
        way_out: &'static str,
    },
    /// The bytes are not a valid file of their format.
    #[error("{name}: damaged or invalid {format} file: {reason}")]
    Invalid {
        /// Path or name.
        name: String,
        /// Detected format.
        format: Format,
        /// Cause.
        reason: String,
    },
    /// The file appears valid, but uses an unsupported feature or the wrong format for its purpose.
    #[error("{name}: unsupported {format} file: {feature}")]
    Unsupported {
        /// Path or name.
        name: String,
        /// Detected format.
        format: Format,
        /// The unsupported compression, pixel type or layout.
        feature: String,
    },
    /// The declared size exceeds a limit of this crate or is implausible for the number of bytes.
    #[error("{name}: the declared size of the {format} file, {width} × {height} pixels, is too large: {limit}")]
    TooLarge {
        /// Path or name.
        name: String,
        /// Detected format.
        format: Format,
        /// Declared width in pixels.
        width: u64,
        /// Declared height in pixels.
        height: u64,
        /// The exceeded limit.
        limit: String,
    },
    /// The extension of an output file is missing, or its format cannot hold the image.
    #[error("{}: {}; use one of {supported}", path.display(), extension_problem(path))]
    OutputFormat {
        /// The file.
        path: PathBuf,
        /// Supported extensions.
        supported: &'static str,
    },
    /// The image cannot be encoded in the output format.
    #[error("{}: cannot encode the image as {format}: {reason}", path.display())]
    Encode {
        /// The file.
        path: PathBuf,
        /// Format of the file.
        format: Format,
        /// Cause.
        reason: String,
    },
}

fn extension_problem(path: &Path) -> String {
    match path.extension() {
        Some(extension) => format!("cannot write an image of this type as “.{}”", extension.to_string_lossy()),
        None => "the file name has no extension".to_owned(),
    }
}
