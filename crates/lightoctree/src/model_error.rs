use lo_insert::InsertError;
use lo_mesh::MeshError;

use crate::builtin_names::{BUILTIN_MODELS, BUILTIN_PREFIX};

/// An error in the objects of a layout or document, or in their meshes.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ModelError {
    /// The mesh cannot be read or is invalid.
    #[error(transparent)]
    Mesh(#[from] MeshError),
    /// A material cannot be read or is invalid.
    #[error("material of {object}: {source}")]
    Material {
        /// Name of the object.
        object: String,
        /// Underlying error.
        source: MeshError,
    },
    /// The layout in a scene file is invalid.
    #[error("the scene's objects: {0}")]
    Layout(#[from] InsertError),
    /// An object in a scene file refers to a file outside it.
    #[error("the scene's objects: {object} needs {file}, which is not in the scene file")]
    ExternalFile {
        /// Name of the object.
        object: String,
        /// Name of the file.
        file: String,
    },
    /// The document does not contain the mesh.
    #[error("the scene does not contain the mesh {name}")]
    MissingMesh {
        /// Name of the mesh.
        name: String,
    },
    /// No built-in model has this name.
    #[error(
        "there is no built-in model {BUILTIN_PREFIX}{name}; choose one of {}",
        BUILTIN_MODELS.map(|name| format!("{BUILTIN_PREFIX}{name}")).join(", ")
    )]
    Builtin {
        /// The requested name, without [`BUILTIN_PREFIX`].
        name: String,
    },
}
