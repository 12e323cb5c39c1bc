/// Why an object cannot be inserted.
#[derive(Debug, thiserror::Error)]
pub enum InsertError {
    /// The pixel does not lie in the photo.
    #[error("pixel ({u}, {v}) lies outside of the {width} × {height} photo")]
    PixelOutside {
        /// Horizontal position in pixels.
        u: f64,
        /// Vertical position in pixels.
        v: f64,
        /// Photo width in pixels.
        width: usize,
        /// Photo height in pixels.
        height: usize,
    },
    /// No surface is known at the pixel.
    #[error("the depth map has no reading at pixel ({u}, {v}); choose another pixel or give the position in metres")]
    NoDepth {
        /// Horizontal position in pixels.
        u: f64,
        /// Vertical position in pixels.
        v: f64,
    },
    /// A number of the placement is NaN, infinite or out of range.
    #[error("placement: {name} must be {needed}, got {found}")]
    Placement {
        /// Which number.
        name: &'static str,
        /// What it must be.
        needed: &'static str,
        /// What it is.
        found: String,
    },
    /// The model has no extent to scale.
    #[error("the model has no extent: {0}")]
    EmptyModel(String),
    /// One of several objects cannot be inserted.
    #[error("object {}: {source}", .object + 1)]
    Object {
        /// Which one, from 0.
        object: usize,
        /// Why.
        source: Box<InsertError>,
    },
    /// An object that others carry is not above them.
    #[error("{0}")]
    NotCarried(&'static str),
    /// A height was asked for of a model that has none.
    #[error("the mesh is flat and has no height; give a scale")]
    Flat,
    /// The environment map cannot light anything.
    #[error("the environment map {0}")]
    EnvironmentMap(String),
    /// The lighting octree cannot be traced.
    #[error("the scene's lighting octree: {0}")]
    Octree(#[from] lo_cone::TracerError),
    /// The handler of events asked for the end.
    #[error(transparent)]
    Cancelled(#[from] lo_events::Cancelled),
    /// The path's JSON text cannot be read.
    #[error("path: {0}")]
    PathSyntax(#[from] serde_json::Error),
    /// The path's keyframes make no sense.
    #[error("path: {0}")]
    Path(String),
    /// The layout's text cannot be read, or makes no sense.
    #[error("layout: {0}")]
    Layout(String),
}

impl InsertError {
    /// The error as that of object number `object`.
    pub(crate) fn of(self, object: usize) -> Self {
        Self::Object { object, source: Box::new(self) }
    }
}
