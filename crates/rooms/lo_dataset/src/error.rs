use std::path::{Path, PathBuf};

/// Error of a dataset. Every message names the file and the part of it.
#[derive(Debug, thiserror::Error)]
pub enum DatasetError {
    /// A file system operation failed.
    #[error("{}: {source}", path.display())]
    Io {
        /// File or folder.
        path: PathBuf,
        /// Error of the operating system.
        source: std::io::Error,
    },
    /// An image cannot be read. The message names its file.
    #[error(transparent)]
    Image(#[from] lo_imaging::ImageError),
    /// A file's content does not match its layout.
    #[error("{}: {field}: {reason}", path.display())]
    Field {
        /// Path of the file.
        path: PathBuf,
        /// Line, key or property.
        field: String,
        /// Description of the problem.
        reason: String,
    },
    /// A shard is not a tar archive or is damaged.
    #[error("{}: {reason}", shard.display())]
    Shard {
        /// Path of the archive.
        shard: PathBuf,
        /// Description of the problem.
        reason: String,
    },
    /// A member of a shard does not match the format.
    #[error("{}: member {member}: {field}: {reason}", shard.display())]
    Member {
        /// Path of the archive.
        shard: PathBuf,
        /// Name within the archive.
        member: String,
        /// Part of the member.
        field: String,
        /// Description of the problem.
        reason: String,
    },
    /// A folder does not have the expected layout.
    #[error("{}: {reason}", folder.display())]
    Layout {
        /// Path of the folder.
        folder: PathBuf,
        /// The missing or unknown part.
        reason: String,
    },
    /// A folder of shards was created with other settings.
    #[error("{} was created with other settings ({field} differs)", folder.display())]
    OtherManifest {
        /// Path of the folder.
        folder: PathBuf,
        /// First field of its manifest that differs.
        field: String,
    },
    /// A sample index is out of range.
    #[error("sample index {index} is out of range; the dataset has {len} samples")]
    Index {
        /// Requested index.
        index: usize,
        /// Number of samples.
        len: usize,
    },
    /// A scene cannot be generated.
    #[error("scene {scene_id}: {reason}")]
    Generate {
        /// Id of the scene.
        scene_id: String,
        /// Description of the problem.
        reason: String,
    },
}

impl DatasetError {
    pub(crate) fn io(path: &Path) -> impl FnOnce(std::io::Error) -> Self {
        move |source| Self::Io { path: path.to_owned(), source }
    }

    pub(crate) fn field(path: &Path, field: impl Into<String>, reason: impl ToString) -> Self {
        Self::Field { path: path.to_owned(), field: field.into(), reason: reason.to_string() }
    }

    pub(crate) fn layout(folder: &Path, reason: impl Into<String>) -> Self {
        Self::Layout { folder: folder.to_owned(), reason: reason.into() }
    }
}
