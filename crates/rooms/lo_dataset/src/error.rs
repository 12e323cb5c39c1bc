use std::path::{Path, PathBuf};

/// What went wrong with a dataset; every message names the file and what in it.
#[derive(Debug, thiserror::Error)]
pub enum DatasetError {
    /// The file system refused.
    #[error("{}: {source}", path.display())]
    Io {
        /// File or folder.
        path: PathBuf,
        /// What the system says.
        source: std::io::Error,
    },
    /// A picture cannot be read; the message names its file.
    #[error(transparent)]
    Image(#[from] lo_imaging::ImageError),
    /// A file does not hold what its layout promises.
    #[error("{}: {field}: {reason}", path.display())]
    Field {
        /// The file.
        path: PathBuf,
        /// Line, key or property.
        field: String,
        /// What is wrong.
        reason: String,
    },
    /// A shard is no tar archive, or a damaged one.
    #[error("{}: {reason}", shard.display())]
    Shard {
        /// The archive.
        shard: PathBuf,
        /// What is wrong.
        reason: String,
    },
    /// A member of a shard does not hold what the format promises.
    #[error("{}: member {member}: {field}: {reason}", shard.display())]
    Member {
        /// The archive.
        shard: PathBuf,
        /// Name inside of the archive.
        member: String,
        /// Which part of it.
        field: String,
        /// What is wrong.
        reason: String,
    },
    /// A folder is not laid out as expected.
    #[error("{}: {reason}", folder.display())]
    Layout {
        /// The folder.
        folder: PathBuf,
        /// What is missing or unknown.
        reason: String,
    },
    /// A folder of shards was begun with other settings.
    #[error("{} was begun with another {field}", folder.display())]
    OtherManifest {
        /// The folder.
        folder: PathBuf,
        /// The first field of its manifest that differs.
        field: String,
    },
    /// There is no such sample.
    #[error("sample {index} of {len}")]
    Index {
        /// As asked for.
        index: usize,
        /// How many there are.
        len: usize,
    },
    /// A scene cannot be generated.
    #[error("scene {scene_id}: {reason}")]
    Generate {
        /// The scene.
        scene_id: String,
        /// What is wrong.
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
