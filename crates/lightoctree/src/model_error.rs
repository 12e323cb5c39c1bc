use lo_insert::InsertError;
use lo_mesh::MeshError;

use crate::{BUILTIN_MODELS, BUILTIN_PREFIX};

/// Why an object has no model.
#[derive(Debug, thiserror::Error)]
pub enum ModelError {
    /// The mesh cannot be used.
    #[error(transparent)]
    Mesh(#[from] MeshError),
    /// Its material cannot be used.
    #[error("material of {object}: {source}")]
    Material {
        /// The object's name.
        object: String,
        /// Why not.
        source: MeshError,
    },
    /// What stands in a scene is no layout.
    #[error("the scene's objects: {0}")]
    Layout(#[from] InsertError),
    /// An object of a scene names a file beside it.
    #[error("the scene's objects: {object} needs {what}, which the scene does not hold")]
    Outside {
        /// The object's name.
        object: String,
        /// The file.
        what: String,
    },
    /// A scene does not hold a mesh.
    #[error("the scene does not hold the mesh {name}")]
    NotHeld {
        /// Which.
        name: String,
    },
    /// The library carries no such model.
    #[error("there is no {BUILTIN_PREFIX}{name}; there are {}", BUILTIN_MODELS.map(|name| format!("{BUILTIN_PREFIX}{name}")).join(", "))]
    Builtin {
        /// What was asked for.
        name: String,
    },
}
