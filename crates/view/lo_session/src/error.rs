use lightoctree::imaging::ImageError;
use lightoctree::insert::InsertError;
use lightoctree::lights::LightsError;
use lightoctree::mesh::MeshError;

/// Why a command is not carried out, or there is no picture.
#[derive(Debug, thiserror::Error)]
pub enum SessionError {
    /// No object has this number.
    #[error("there is no object {0}")]
    NoObject(u32),
    /// No mesh has this name.
    #[error("there is no mesh called {0}")]
    NoMesh(String),
    /// No light has this name.
    #[error("there is no light called {0}")]
    NoLight(String),
    /// The object has no keyframe there.
    #[error("the object has no keyframe at that time")]
    NoKeyframe,
    /// Another object has that name.
    #[error("another object is called {0} already")]
    NameTaken(String),
    /// A number that is out of its range.
    #[error("{name} must be {needed}, got {found}")]
    Number {
        /// Which.
        name: &'static str,
        /// What it must be.
        needed: &'static str,
        /// What it is.
        found: f64,
    },
    /// More than a session holds.
    #[error("there are {limit} {what} already, and no more are kept")]
    Full {
        /// Of what.
        what: &'static str,
        /// How many.
        limit: usize,
    },
    /// Something out of its range.
    #[error("{0} is out of range")]
    Range(&'static str),
    /// What the light at hand does not depend on.
    #[error("{0}")]
    NoEffect(&'static str),
    /// The scene cannot be lit so.
    #[error(transparent)]
    Lighting(#[from] lightoctree::LightingError),
    /// Numbers of a sequence that are out of range.
    #[error("{0}")]
    Shown(&'static str),
    /// Nothing moves.
    #[error("nothing moves yet: add a keyframe first")]
    NothingMoves,
    /// There is no picture without objects but the photo.
    #[error("nothing stands in the photo yet")]
    NoObjects,
    /// An object cannot stand so, or be rendered.
    #[error(transparent)]
    Insert(#[from] InsertError),
    /// A mesh or material cannot be used.
    #[error(transparent)]
    Mesh(#[from] MeshError),
    /// What stands in the scene's file cannot stand there.
    #[error(transparent)]
    Model(#[from] lightoctree::ModelError),
    /// An object of the scene's file is told in a way that only the command line knows.
    #[error("the scene's objects: {object} has {what}, which this page does not know; `lightoctree insert` does")]
    Foreign {
        /// Its name.
        object: String,
        /// What of it.
        what: &'static str,
    },
    /// Edits of lights do not fit the scene.
    #[error(transparent)]
    Lights(#[from] LightsError),
    /// A picture cannot be written.
    #[error(transparent)]
    Image(#[from] ImageError),
    /// The scene cannot be written.
    #[error(transparent)]
    Document(#[from] lightoctree::DocumentError),
    /// The scene cannot be exported.
    #[error(transparent)]
    Export(#[from] lightoctree::export::ExportError),
    /// The light cannot be traced.
    #[error(transparent)]
    Tracer(#[from] lightoctree::cone::TracerError),
    /// No folder for an export's files.
    #[error("temporary files: {0}")]
    Temporary(#[from] std::io::Error),
    /// The layout cannot be written.
    #[error("layout: {0}")]
    Json(#[from] serde_json::Error),
}

impl SessionError {
    /// Whether the handler of events asked for the end.
    pub fn is_cancelled(&self) -> bool {
        matches!(self, Self::Insert(InsertError::Cancelled(_)))
    }
}
