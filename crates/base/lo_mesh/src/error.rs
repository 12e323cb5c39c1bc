use std::path::PathBuf;

/// Why a mesh, a material or a texture could not be used.
#[derive(Debug, thiserror::Error)]
pub enum MeshError {
    /// The file could not be read.
    #[error("cannot read {}: {source}", path.display())]
    Io {
        /// File asked for.
        path: PathBuf,
        /// What the system says.
        source: std::io::Error,
    },
    /// Something is wrong inside the named file.
    #[error("{}: {source}", path.display())]
    InFile {
        /// File that was read.
        path: PathBuf,
        /// What is wrong with it.
        source: Box<MeshError>,
    },
    /// Neither the name nor the first bytes tell the format.
    #[error("not a mesh format that can be read (glTF, GLB, OBJ, PLY and STL can)")]
    UnknownFormat,
    /// The bytes break the rules of their format.
    #[error("broken {format} at {place}: {what}")]
    Syntax {
        /// Name of the format.
        format: &'static str,
        /// Line, byte or element.
        place: String,
        /// What is wrong there.
        what: String,
    },
    /// glTF `extensionsRequired` names something that is not supported.
    #[error("needs the glTF extension {name}, which is not supported: {remedy}")]
    UnsupportedExtension {
        /// Name of the extension.
        name: String,
        /// How to get a file that can be read.
        remedy: &'static str,
    },
    /// A file that holds vertices, named by a glTF, is missing.
    #[error("the mesh keeps its vertices in {}, which cannot be read: {reason}", path.display())]
    MissingBuffer {
        /// File named by the mesh.
        path: PathBuf,
        /// What the system says.
        reason: String,
    },
    /// A triangle names a vertex that does not exist.
    #[error("{place} names vertex {index}, but there are {count} vertices (counted from 0)")]
    IndexOutOfRange {
        /// Triangle, line or primitive.
        place: String,
        /// The index, counted from 0.
        index: i64,
        /// Number of vertices.
        count: usize,
    },
    /// Nothing to show.
    #[error("the mesh has no triangles{reason}")]
    NoTriangles {
        /// Why, where it is known; begins with a separator.
        reason: String,
    },
    /// The counts are far beyond what a file of this size can mean.
    #[error("the mesh unfolds to {count} {what}, more than a file of this size may ask for ({limit})")]
    TooLarge {
        /// What there are too many of.
        what: &'static str,
        /// How many.
        count: u64,
        /// How many are allowed.
        limit: u64,
    },
    /// Neither a preset nor JSON.
    #[error("no material is called '{name}'; give JSON such as {{\"base_color\":[0.8,0.1,0.1]}} or one of: {known}")]
    UnknownMaterial {
        /// Name asked for.
        name: String,
        /// Names that exist.
        known: String,
    },
    /// A material description that does not parse or holds a value out of range.
    #[error("material JSON: {0}")]
    MaterialJson(String),
    /// A picture that the user asked for cannot be used.
    #[error("texture {name}: {reason}")]
    Texture {
        /// File or image name.
        name: String,
        /// Why not.
        reason: String,
    },
}

impl MeshError {
    pub(crate) fn syntax(format: &'static str, place: impl Into<String>, what: impl Into<String>) -> Self {
        Self::Syntax { format, place: place.into(), what: what.into() }
    }
}
