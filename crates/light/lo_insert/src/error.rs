/// Reasons why an object cannot be inserted.
#[derive(Debug, thiserror::Error)]
pub enum InsertError {
    /// The pixel is outside of the photo.
    #[error("pixel ({u}, {v}) is outside the {width} × {height} photo")]
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
    /// The depth map has no reading at the pixel.
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
        /// Name of the number.
        name: &'static str,
        /// Valid values.
        needed: &'static str,
        /// Actual value.
        found: String,
    },
    /// The model has no extent to scale.
    #[error("the model has no extent: {0}")]
    EmptyModel(String),
    /// One of several objects cannot be inserted.
    #[error("object {}: {source}", .object + 1)]
    Object {
        /// Index of the object, from 0.
        object: usize,
        /// Reason.
        source: Box<InsertError>,
    },
    /// The object is not above its carrier.
    #[error("{0}")]
    NotCarried(&'static str),
    /// A height was requested for a flat model.
    #[error("the mesh is flat and has no height; give a scale")]
    Flat,
    /// The environment map cannot light anything.
    #[error("the environment map {0}")]
    EnvironmentMap(String),
    /// The lighting octree cannot be traced.
    #[error("the scene's lighting octree: {0}")]
    Octree(#[from] lo_cone::TracerError),
    /// The event handler cancelled the job.
    #[error(transparent)]
    Cancelled(#[from] lo_events::Cancelled),
    /// The path's JSON cannot be parsed.
    #[error("path: {0}")]
    PathSyntax(#[from] serde_json::Error),
    /// The path's keyframes are invalid.
    #[error("path: {0}")]
    Path(String),
    /// The layout cannot be parsed or is invalid.
    #[error("layout: {0}")]
    Layout(String),
}

impl InsertError {
    /// Wraps the error as that of object number `object`.
    pub(crate) fn of(self, object: usize) -> Self {
        Self::Object { object, source: Box::new(self) }
    }
}
