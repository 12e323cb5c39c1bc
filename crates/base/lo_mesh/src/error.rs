use std::path::PathBuf;

/// Errors of reading meshes, materials and textures.
#[derive(Debug, thiserror::Error)]
pub enum MeshError {
    /// The file could not be read.
    #[error("cannot read {}: {source}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// Error of the operating system.
        source: std::io::Error,
    },
    /// An error in the contents of a file.
    #[error("{}: {source}", path.display())]
    InFile {
        /// The file.
        path: PathBuf,
        /// The error.
        source: Box<MeshError>,
    },
    /// Neither the extension nor the first bytes identify a format.
    #[error("unrecognised mesh format; supported formats are glTF, GLB, OBJ, PLY and STL")]
    UnknownFormat,
    /// The bytes are not a valid file of their format.
    #[error("invalid {format} file at {place}: {what}")]
    Syntax {
        /// Name of the format.
        format: &'static str,
        /// Line, byte or element.
        place: String,
        /// Cause.
        what: String,
    },
    /// glTF `extensionsRequired` lists an unsupported extension.
    #[error("the file requires the unsupported glTF extension {name}: {remedy}")]
    UnsupportedExtension {
        /// Name of the extension.
        name: String,
        /// How to obtain a supported file.
        remedy: &'static str,
    },
    /// A buffer file of a glTF, with its vertices, could not be read.
    #[error("cannot read {}, which contains the mesh's vertices: {reason}", path.display())]
    MissingBuffer {
        /// File named in the mesh.
        path: PathBuf,
        /// Error of the operating system.
        reason: String,
    },
    /// A triangle refers to a vertex that does not exist.
    #[error("{place} refers to vertex {index}, but there are {count} vertices (counted from 0)")]
    IndexOutOfRange {
        /// Triangle, line or primitive.
        place: String,
        /// The index, counted from 0.
        index: i64,
        /// Number of vertices.
        count: usize,
    },
    /// The mesh has no usable triangle.
    #[error("the mesh has no triangles{reason}")]
    NoTriangles {
        /// Cause, if known; begins with a separator.
        reason: String,
    },
    /// The file has no animation of a name.
    #[error("it has no animation `{name}`; {}", if names.is_empty() { "it has none".to_owned() } else { format!("its animations are {}", names.join(", ")) })]
    NoAnimation {
        /// The name.
        name: String,
        /// Names of its animations.
        names: Vec<String>,
    },
    /// A count exceeds the limit for a file of this size.
    #[error("the mesh expands to {count} {what}, more than the limit of {limit} for a file of this size")]
    TooLarge {
        /// Name of the counted elements.
        what: &'static str,
        /// Their number.
        count: u64,
        /// Largest allowed number.
        limit: u64,
    },
    /// The material is neither a preset nor JSON.
    #[error("unknown material '{name}'; give JSON such as {{\"base_color\":[0.8,0.1,0.1]}} or one of: {known}")]
    UnknownMaterial {
        /// The given name.
        name: String,
        /// Names of the presets.
        known: String,
    },
    /// A material description does not parse or has a value out of range.
    #[error("material JSON: {0}")]
    MaterialJson(String),
    /// An image requested by the user cannot be used as a texture.
    #[error("texture {name}: {reason}")]
    Texture {
        /// File or image name.
        name: String,
        /// Cause.
        reason: String,
    },
}

impl MeshError {
    pub(crate) fn syntax(format: &'static str, place: impl Into<String>, what: impl Into<String>) -> Self {
        Self::Syntax { format, place: place.into(), what: what.into() }
    }
}
