use geometry::CameraError;

/// Why photo, depth and camera do not make a frame.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum FrameError {
    /// The camera belongs to another resolution.
    #[error(
        "the camera is that of a {} × {} image, but the photo has {} × {} pixels; intrinsics must be those of the photo's own \
         resolution", camera.0, camera.1, photo.0, photo.1
    )]
    CameraSize {
        /// Width and height that the camera names.
        camera: (u32, u32),
        /// Width and height of the photo.
        photo: (usize, usize),
    },
    /// The intrinsics are not those of a pinhole.
    #[error(transparent)]
    Camera(#[from] CameraError),
    /// The exposure is not a positive number.
    #[error("the exposure must be positive and finite, got {0}")]
    Exposure(f32),
    /// Photo and depth cannot show the same field of view.
    #[error(
        "the depth map ({} × {}) and the photo ({} × {}) differ in aspect ratio by more than 2 %: they must show the same field \
         of view", depth.0, depth.1, photo.0, photo.1
    )]
    AspectRatio {
        /// Width and height of the depth map.
        depth: (usize, usize),
        /// Width and height of the photo.
        photo: (usize, usize),
    },
    /// The depth map is all holes.
    #[error("the depth map ({} × {}) has no reading at all: every value is zero, negative, NaN or infinite", depth.0, depth.1)]
    NoReadings {
        /// Width and height of the depth map.
        depth: (usize, usize),
    },
    /// The depth map is nearly all holes.
    #[error("the depth map has only {found} readings, at least {needed} are needed")]
    TooFewReadings {
        /// Positive finite values found.
        found: usize,
        /// Fewest that are enough.
        needed: usize,
    },
    /// The depths are not those of a room.
    #[error("the median depth is {median_m} m, which no room has; is the depth scale (units per metre) right?")]
    DepthScale {
        /// Median of all readings in metres.
        median_m: f32,
    },
}
