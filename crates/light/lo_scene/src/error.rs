use lo_geometry::CameraError;

/// Reasons why photo, depth and camera do not form a frame.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum FrameError {
    /// The camera belongs to another resolution.
    #[error(
        "the camera is that of a {} × {} image, but the photo has {} × {} pixels; intrinsics must be those of the photo's own \
         resolution", camera.0, camera.1, photo.0, photo.1
    )]
    CameraSize {
        /// Width and height of the camera's image.
        camera: (u32, u32),
        /// Width and height of the photo.
        photo: (usize, usize),
    },
    /// The intrinsics are not those of a pinhole camera.
    #[error(transparent)]
    Camera(#[from] CameraError),
    /// The exposure is out of range.
    #[error("the exposure must be within ± 40 stops, a factor from 9.1e-13 to 1.1e12; got {0}")]
    Exposure(f32),
    /// A linear photo consists of NaN and infinite values.
    #[error("the photo has no finite value: every value is NaN or infinite")]
    NoPixels,
    /// A linear photo is too bright.
    #[error(
        "the photo's largest value is {largest:e}, its exposure {exposure}; values and radiance must not exceed {limit:e}"
    )]
    Radiance {
        /// Largest absolute value.
        largest: f32,
        /// Factor from values to radiance.
        exposure: f32,
        /// Largest accepted radiance.
        limit: f32,
    },
    /// Photo and depth do not show the same field of view.
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
    /// The depth map has no readings.
    #[error("the depth map ({} × {}) has no readings: every value is zero, negative, NaN or infinite", depth.0, depth.1)]
    NoReadings {
        /// Width and height of the depth map.
        depth: (usize, usize),
    },
    /// The depth map has too few readings.
    #[error("the depth map has only {found} readings; at least {needed} are needed")]
    TooFewReadings {
        /// Positive finite values found.
        found: usize,
        /// Minimum number of readings.
        needed: usize,
    },
    /// The median depth is not that of a room.
    #[error("the median depth is {median_m} m, which no room has; check the depth scale (units per metre)")]
    DepthScale {
        /// Median of all readings, metres.
        median_m: f32,
    },
}

/// Reasons why a scene file cannot be read or written.
#[derive(Debug, thiserror::Error)]
pub enum SceneError {
    /// The file cannot be read.
    #[error("{path}: {source}")]
    Read {
        /// Path of the file.
        path: String,
        /// Error of the operating system.
        source: std::io::Error,
    },
    /// The file cannot be written; the message names the path.
    #[error(transparent)]
    Write(std::io::Error),
    /// The file is not a safetensors file, or is damaged.
    #[error("not a scene file, or a damaged one: {0}")]
    Container(String),
    /// A safetensors file without scene metadata.
    #[error("a safetensors file without \"{key}\" in its metadata: not a scene file")]
    NoMetadata {
        /// Expected metadata key.
        key: &'static str,
    },
    /// The JSON block is invalid.
    #[error("the scene's metadata: {0}")]
    Metadata(String),
    /// The file has another version of the format.
    #[error("the scene file has format version {got}; this program reads version {known}")]
    Version {
        /// Version of the file.
        got: u32,
        /// Version that this program reads.
        known: u32,
    },
    /// A tensor is missing.
    #[error("tensor {0} is missing")]
    MissingTensor(&'static str),
    /// A tensor has the wrong type or shape.
    #[error("tensor {tensor}: expected {expected}, got {got}")]
    Layout {
        /// Name of the tensor.
        tensor: &'static str,
        /// Expected type and shape.
        expected: &'static str,
        /// Actual type and shape.
        got: String,
    },
    /// A value is out of range.
    #[error("tensor {tensor}, value {index} is {value}; it must be from {least:e} to {most:e}")]
    Value {
        /// Name of the tensor.
        tensor: &'static str,
        /// Index of the value, with all axes flattened.
        index: usize,
        /// The value.
        value: f32,
        /// Smallest valid value.
        least: f32,
        /// Largest valid value.
        most: f32,
    },
    /// Photo, depth and camera do not form a frame.
    #[error(transparent)]
    Frame(#[from] FrameError),
    /// The objects in the photo are invalid.
    #[error("the scene's objects: {0}")]
    Objects(String),
    /// The octree is damaged.
    #[error("the lighting octree: {0}")]
    Octree(#[from] lo_octree::OctreeError),
}
