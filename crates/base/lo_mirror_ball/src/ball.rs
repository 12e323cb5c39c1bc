/// Smallest radius of a ball that can be unwrapped.
pub(super) const MIN_RADIUS_PX: f64 = 4.0;

/// The ball's outline in the photo, in pixels; pixel centres are at +0.5.
///
/// A pinhole images a ball off its axis as an ellipse: then the ellipse's centre and its mean semi-axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BallCircle {
    /// Horizontal coordinate of the centre.
    pub x: f64,
    /// Vertical coordinate of the centre, downwards.
    pub y: f64,
    /// Radius.
    pub radius_px: f64,
}

/// The camera model of a ball photo.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum BallLens {
    /// Unknown lens: an orthographic view, as from far away.
    Orthographic,
    /// A pinhole with its principal point at the photo's centre.
    Focal {
        /// Focal length in pixels of the photo.
        focal_px: f64,
    },
    /// A pinhole with its principal point at the photo's centre and a focal length that follows from the ball's size.
    Distance {
        /// Distance from the pinhole to the ball's centre, in radii of the ball.
        radii: f64,
    },
}
