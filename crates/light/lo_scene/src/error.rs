use lo_geometry::CameraError;

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

/// Why a scene file cannot be read or written.
#[derive(Debug, thiserror::Error)]
pub enum SceneError {
    /// The file system refused to read.
    #[error("{path}: {source}")]
    Read {
        /// The file.
        path: String,
        /// What the system says.
        source: std::io::Error,
    },
    /// The file system refused to write; the message names the path.
    #[error(transparent)]
    Write(std::io::Error),
    /// The file is longer than any scene.
    #[error("the file has {bytes} bytes; scenes have at most {most}")]
    TooLarge {
        /// Length of the file.
        bytes: u64,
        /// Longest that is read.
        most: u64,
    },
    /// Not a safetensors file, or a damaged one.
    #[error("not a scene file, or a damaged one: {0}")]
    Container(String),
    /// A safetensors file of something else.
    #[error("a safetensors file without \"{key}\" in its metadata: not a scene file")]
    NoMetadata {
        /// The key that scenes have.
        key: &'static str,
    },
    /// The JSON block is damaged.
    #[error("the scene's metadata: {0}")]
    Metadata(String),
    /// Another version of the format.
    #[error("the scene file has format version {got}; this program reads version {known}")]
    Version {
        /// Version in the file.
        got: u32,
        /// Version that can be read.
        known: u32,
    },
    /// A tensor is not there.
    #[error("tensor {0} is missing")]
    MissingTensor(&'static str),
    /// A tensor has the wrong type or shape.
    #[error("tensor {tensor}: expected {expected}, got {got}")]
    Layout {
        /// Its name.
        tensor: &'static str,
        /// What it should be.
        expected: &'static str,
        /// What it is.
        got: String,
    },
    /// A value is not a number.
    #[error("tensor {tensor}, value {index} is {value}")]
    Value {
        /// Name of the tensor.
        tensor: &'static str,
        /// Index of the value, all axes flattened.
        index: usize,
        /// The value.
        value: f32,
    },
    /// Photo, depth and camera do not belong together.
    #[error(transparent)]
    Frame(#[from] FrameError),
    /// What stands in the photo is damaged.
    #[error("the scene's objects: {0}")]
    Objects(String),
    /// The octree is damaged.
    #[error("the lighting octree: {0}")]
    Octree(#[from] lo_octree::OctreeError),
}
