use lo_geometry::Vec3;

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
    /// The surface at the pixel is too steep to stand on.
    #[error(
        "pixel ({u}, {v}) shows a surface tilted by {tilt_deg:.0}°, on which nothing stands{}",
        below_text(*.below_m, *.below_pixel)
    )]
    Steep {
        /// Horizontal position in pixels.
        u: f64,
        /// Vertical position in pixels.
        v: f64,
        /// Angle between the surface's normal and the vertical, in degrees.
        tilt_deg: f32,
        /// World position of the surface at the pixel, in metres.
        position_m: Vec3,
        /// World position in metres of a supporting surface below, if there is one.
        below_m: Option<Vec3>,
        /// The pixel that shows it, if any.
        below_pixel: Option<[f64; 2]>,
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

/// Formats where a supporting surface is.
fn below_text(below_m: Option<Vec3>, pixel: Option<[f64; 2]>) -> String {
    let Some(at) = below_m else { return String::new() };
    let position = format!("({:.2}, {:.2}, {:.2}) m", at.x, at.y, at.z);
    match pixel {
        Some([u, v]) => format!("; the surface below it is at pixel ({u}, {v}), {position}"),
        None => format!("; the floor below it is outside the photo, at {position}"),
    }
}

impl InsertError {
    /// Wraps the error as that of object number `object`.
    pub(crate) fn of(self, object: usize) -> Self {
        Self::Object { object, source: Box::new(self) }
    }
}
