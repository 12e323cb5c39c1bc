/// Why a file of poses cannot be used. Poses are named as their file names them: by a photo's file, a line or a number.
#[derive(Debug, thiserror::Error)]
pub enum PoseError {
    /// The file system refused to read.
    #[error("{path}: {source}")]
    Read {
        /// The file.
        path: String,
        /// What the system says.
        source: std::io::Error,
    },
    /// Longer than any file of poses.
    #[error("{file}: {bytes} bytes are too many for a file of poses; at most {most} are read")]
    TooLarge {
        /// The file.
        file: String,
        /// Its length.
        bytes: u64,
        /// Longest that is read.
        most: u64,
    },
    /// The content is that of no format that is known.
    #[error(
        "{0}: no known file of poses; known are lightoctree's own (`photos`), Record3D's metadata.json (`poses`), frames of 3D Scanner App \
         (`cameraPoseARFrame`) and Polycam (`t_00`), transforms.json (`frames`), and TUM trajectories (lines of `time tx ty tz qx qy qz qw`)"
    )]
    Unknown(String),
    /// The format is known, the content is wrong.
    #[error("{file}: {what}")]
    Content {
        /// The file.
        file: String,
        /// What is wrong, and where.
        what: String,
    },
    /// The cameras are no pinholes.
    #[error("{file}: its camera model is {model}; only photos of pinhole cameras can be used")]
    CameraModel {
        /// The file.
        file: String,
        /// What it says.
        model: String,
    },
    /// A number is NaN or infinite, or beyond all reason.
    #[error("{file}: the pose of {pose} holds {value}, which is no number of metres")]
    Value {
        /// The file.
        file: String,
        /// Which pose.
        pose: String,
        /// The number.
        value: f64,
    },
    /// A matrix that enlarges.
    #[error("{file}: the pose of {pose} scales by {scale:.3}; a camera's pose turns and moves only, in metres")]
    Scale {
        /// The file.
        file: String,
        /// Which pose.
        pose: String,
        /// Length of the longest or shortest axis, which should be 1.
        scale: f64,
    },
    /// A matrix that mirrors.
    #[error("{file}: the pose of {pose} mirrors: its axes are left-handed")]
    Mirror {
        /// The file.
        file: String,
        /// Which pose.
        pose: String,
    },
    /// A matrix that shears, or whose last row is no 0 0 0 1, or a quaternion that is not of unit length.
    #[error("{file}: the pose of {pose} is no rotation with a position: {what}")]
    NotRigid {
        /// The file.
        file: String,
        /// Which pose.
        pose: String,
        /// What is wrong.
        what: String,
    },
    /// As many files as photos are needed where each holds one pose.
    #[error("{files} files of poses for {photos} photos: one for all, or one for each")]
    FileCount {
        /// Files given.
        files: usize,
        /// Photos.
        photos: usize,
    },
    /// One of several files holds more or fewer poses than the one of its photo.
    #[error("{file} holds {poses} poses; where there is one file for each photo, each holds one")]
    OneEach {
        /// The file.
        file: String,
        /// How many it holds.
        poses: usize,
    },
    /// A photo has no pose.
    #[error("{file} holds no pose of {photo} ({rule})")]
    NoPose {
        /// The file.
        file: String,
        /// The photo.
        photo: String,
        /// How photos are matched with poses in files of this kind.
        rule: &'static str,
    },
    /// A photo has several poses.
    #[error("{file} holds several poses of {photo}")]
    Ambiguous {
        /// The file.
        file: String,
        /// The photo.
        photo: String,
    },
    /// Two cameras are farther apart than a room is long.
    #[error(
        "{first} and {other} were taken {distance_m:.1} m apart by their poses, farther than any room is long ({most_m} m): are they in metres?"
    )]
    Distance {
        /// A photo.
        first: String,
        /// Another.
        other: String,
        /// Their distance by the poses.
        distance_m: f64,
        /// Greatest distance that is believed.
        most_m: f64,
    },
    /// The intrinsics are those of a picture of another shape.
    #[error(
        "{file}: intrinsics for {} × {} pixels, but {photo} has {} × {}: was the photo turned or cut after it was taken?",
        stated.0, stated.1, found.0, found.1
    )]
    PictureSize {
        /// The file.
        file: String,
        /// The photo.
        photo: String,
        /// Width and height that the file states.
        stated: (u32, u32),
        /// Width and height of the photo.
        found: (u32, u32),
    },
    /// The intrinsics are those of no camera.
    #[error("{file}: the camera of {photo}: {source}")]
    Camera {
        /// The file.
        file: String,
        /// The photo.
        photo: String,
        /// What is wrong.
        source: lo_geometry::CameraError,
    },
}
