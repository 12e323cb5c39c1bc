use lo_imaging::ImageError;
use lo_insert::InsertError;
use lo_lights::LightsError;
use lo_mesh::MeshError;

/// A command was refused, or an image could not be rendered.
#[derive(Debug, thiserror::Error)]
pub enum SessionError {
    /// No object has this id.
    #[error("there is no object {0}")]
    NoObject(u32),
    /// No mesh has this name.
    #[error("there is no mesh called {0}")]
    NoMesh(String),
    /// No light has this name.
    #[error("there is no light called {0}")]
    NoLight(String),
    /// The light is not an added sun.
    #[error("{0} is no sun that was added")]
    NoSun(String),
    /// The object has no keyframe at the given time.
    #[error("the object has no keyframe at that time")]
    NoKeyframe,
    /// Neither a surface nor the floor is below the object.
    #[error("the photo shows no surface below the object")]
    NothingBelow,
    /// Another object already has this name.
    #[error("another object is already called {0}")]
    NameTaken(String),
    /// A name has no visible character.
    #[error("a name needs a visible character")]
    NoName,
    /// A number is out of range.
    #[error("{name} must be {needed}, got {found}")]
    InvalidNumber {
        /// The name of the number in messages.
        name: &'static str,
        /// The accepted range.
        needed: &'static str,
        /// The value.
        found: f64,
    },
    /// A limit of the session is reached.
    #[error("the session has {limit} {what} already, which is the limit")]
    TooMany {
        /// Plural of the limited things.
        what: &'static str,
        /// The limit.
        limit: usize,
    },
    /// A command cannot be part of a step of several commands.
    #[error("steps of several commands neither move keyframes nor contain other such steps")]
    NotTogether,
    /// A value is out of range.
    #[error("{0} is out of range")]
    OutOfRange(&'static str),
    /// The command has no effect on the current light.
    #[error("{0}")]
    NoEffect(&'static str),
    /// The scene cannot be lit with the chosen light.
    #[error(transparent)]
    Lighting(#[from] lightoctree::LightingError),
    /// The known length gives no scale of the room.
    #[error(transparent)]
    KnownLength(#[from] lightoctree::KnownLengthError),
    /// The frame count or rate of a sequence is out of range.
    #[error("{0}")]
    Sequence(&'static str),
    /// No object has keyframes.
    #[error("nothing is animated yet: add a keyframe first")]
    NothingMoves,
    /// There are no objects, so the image would be the photo.
    #[error("there are no objects in the photo yet")]
    NoObjects,
    /// An object cannot be placed or rendered.
    #[error(transparent)]
    Insert(#[from] InsertError),
    /// A mesh or material cannot be used.
    #[error(transparent)]
    Mesh(#[from] MeshError),
    /// A mesh of the scene file cannot be used.
    #[error(transparent)]
    Model(#[from] lightoctree::ModelError),
    /// An object of the scene file uses a feature that only the command line supports.
    #[error("the scene's objects: {object} has {what}, which the viewer does not support; use `lightoctree insert`")]
    Unsupported {
        /// The object's name.
        object: String,
        /// The unsupported feature.
        what: &'static str,
    },
    /// The light edits do not match the scene.
    #[error(transparent)]
    Lights(#[from] LightsError),
    /// An image cannot be encoded.
    #[error(transparent)]
    Image(#[from] ImageError),
    /// The scene cannot be written.
    #[error(transparent)]
    Document(#[from] lightoctree::DocumentError),
    /// The scene cannot be exported.
    #[error(transparent)]
    Export(#[from] lo_export::ExportError),
    /// The light cannot be traced.
    #[error(transparent)]
    Tracer(#[from] lo_cone::TracerError),
    /// The temporary files of an export cannot be written or read.
    #[error("temporary files: {0}")]
    Temporary(#[from] std::io::Error),
    /// The layout cannot be serialized.
    #[error("layout: {0}")]
    Json(#[from] serde_json::Error),
}

impl SessionError {
    /// Returns whether the event handler cancelled the work.
    pub fn is_cancelled(&self) -> bool {
        matches!(self, Self::Insert(InsertError::Cancelled(_)))
    }
}
