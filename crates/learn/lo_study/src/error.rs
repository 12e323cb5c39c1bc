use lo_dataset::{DatasetError, GeneratorError};
use lo_eval::MethodError;
use lo_imaging::ImageError;
use lo_insert::InsertError;

use crate::StudyConfigError;

/// Reasons why a study cannot be made.
#[derive(Debug, thiserror::Error)]
pub enum StudyError {
    /// A field of the configuration is invalid.
    #[error(transparent)]
    Config(#[from] StudyConfigError),
    /// A field of the rooms' configuration is invalid.
    #[error("generator: {0}")]
    Generator(#[from] GeneratorError),
    /// A room cannot be generated.
    #[error(transparent)]
    Room(#[from] DatasetError),
    /// Too few rooms have a path.
    #[error(
        "only {found} of {tried} rooms have a visible level surface with a free path for both objects, and the study \
         needs {wanted}; a smaller object_size needs less space"
    )]
    TooFewRooms {
        /// Rooms with a path.
        found: usize,
        /// Rooms that were tried.
        tried: u64,
        /// Rooms of the configuration.
        wanted: usize,
    },
    /// A method cannot light objects in a room.
    #[error("{method} in {room}: {source}")]
    Method {
        /// Method.
        method: &'static str,
        /// Identifier of the room.
        room: String,
        /// Cause.
        source: MethodError,
    },
    /// Objects cannot be placed or rendered.
    #[error("{method} in {room}: {source}")]
    Insert {
        /// Method.
        method: &'static str,
        /// Identifier of the room.
        room: String,
        /// Cause.
        source: InsertError,
    },
    /// The depth of a method has no surface along the path.
    #[error("{method} in {room}: its depth has no level surface along the path")]
    NoSurface {
        /// Method.
        method: &'static str,
        /// Identifier of the room.
        room: String,
    },
    /// A frame cannot be written.
    #[error(transparent)]
    Image(#[from] ImageError),
    /// A file or folder cannot be written.
    #[error("cannot write {0}")]
    Io(std::io::Error),
}
