//! The key of a study: which method each side of each pair shows.

use std::path::{Path, PathBuf};
use std::str::FromStr;

use serde::{Deserialize, Serialize};

/// File of the key in the study's folder. Participants do not need it.
pub const KEY_FILE: &str = "key.json";

/// Everything that the evaluation needs to know about a study.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Key {
    /// Identifier, derived from everything that the videos depend on.
    pub study: String,
    /// Method under study.
    pub ours: String,
    /// Methods that it is compared with.
    pub others: Vec<String>,
    /// Method of the video in the middle.
    pub reference: String,
    /// Pairs by ascending identifier.
    pub pairs: Vec<Pair>,
    /// All videos.
    pub videos: Vec<Video>,
}

/// One comparison in one room.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Pair {
    /// Identifier, a number.
    pub id: String,
    /// Identifier of the room.
    pub room: String,
    /// Method that ours is compared with.
    pub other: String,
    /// Side of our method.
    pub ours: Side,
    /// Identifiers of the videos.
    pub left: String,
    /// Video of the reference.
    pub middle: String,
    /// Video on the right.
    pub right: String,
}

/// A method's video of one room.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Video {
    /// Identifier, and name of the folder of its frames. It does not reveal room and method.
    pub id: String,
    /// Identifier of the room.
    pub room: String,
    /// Method.
    pub method: String,
}

/// Side of a video.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Side {
    /// Left of the reference.
    Left,
    /// Right of the reference.
    Right,
}

impl FromStr for Side {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text {
            "left" => Ok(Self::Left),
            "right" => Ok(Self::Right),
            _ => Err(format!("the choice is \"{text}\", not left or right")),
        }
    }
}

/// The key cannot be read.
#[derive(Debug, thiserror::Error)]
pub enum KeyError {
    /// It is missing or not readable.
    #[error("cannot read {path}: {source}")]
    Io {
        /// Path of the key.
        path: PathBuf,
        /// Cause.
        source: std::io::Error,
    },
    /// It is not the key of a study.
    #[error("{path} is not the key of a study: {source}")]
    Json {
        /// Path of the key.
        path: PathBuf,
        /// Cause.
        source: serde_json::Error,
    },
}

impl Key {
    /// Reads the key in a study's folder.
    ///
    /// # Errors
    /// If there is none, or it is damaged.
    pub fn read(folder: &Path) -> Result<Self, KeyError> {
        let path = folder.join(KEY_FILE);
        let text = std::fs::read(&path).map_err(|source| KeyError::Io { path: path.clone(), source })?;
        serde_json::from_slice(&text).map_err(|source| KeyError::Json { path, source })
    }
}
