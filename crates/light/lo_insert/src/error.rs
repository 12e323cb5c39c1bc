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
}
