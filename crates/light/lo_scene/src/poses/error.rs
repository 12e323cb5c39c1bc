/// Reasons why a pose file cannot be used. Poses are identified as in their file: by a photo's file name, a line or a
/// number.
#[derive(Debug, thiserror::Error)]
pub enum PoseError {
    /// The file cannot be read.
    #[error("{path}: {source}")]
    Read {
        /// Path of the file.
        path: String,
        /// Error of the operating system.
        source: std::io::Error,
    },
    /// The format is unknown.
    #[error(
        "{0}: unknown pose file format; supported are lightoctree's own (`photos`), Record3D's metadata.json (`poses`), frames of 3D Scanner App \
         (`cameraPoseARFrame`) and Polycam (`t_00`), transforms.json (`frames`), TUM trajectories (lines of `time tx ty tz qx qy qz qw`), \
         Nuke's .chan (lines of `frame tx ty tz rx ry rz [vfov]`), COLMAP's images.txt, and USD as text (.usda)"
    )]
    Unknown(String),
    /// The format is known, but the content is invalid.
    #[error("{file}: {what}")]
    Content {
        /// Name of the file.
        file: String,
        /// Description of the error and its location.
        what: String,
    },
    /// A COLMAP model is stored as binary files.
    #[error("{0} is binary; convert the model with `colmap model_converter --output_type TXT` and give its images.txt")]
    ColmapBinary(String),
    /// A USD file is binary.
    #[error(
        "{0} is binary USD; export it as text: in Blender give the file the extension .usda, or convert it with usdcat"
    )]
    UsdBinary(String),
    /// The camera model is not supported.
    #[error(
        "{file}: its camera model is {model}; supported are pinhole cameras, also with OpenCV's distortion or fisheye"
    )]
    CameraModel {
        /// Name of the file.
        file: String,
        /// Camera model in the file.
        model: String,
    },
    /// A number is NaN, infinite or out of range.
    #[error("{file}: the pose of {pose} contains {value}, which is not a valid position or rotation")]
    Value {
        /// Name of the file.
        file: String,
        /// Name of the pose.
        pose: String,
        /// The number.
        value: f64,
    },
    /// A matrix has a scale other than 1.
    #[error(
        "{file}: the pose of {pose} scales by {scale:.3}; a camera pose must be a rotation and a translation in metres"
    )]
    Scale {
        /// Name of the file.
        file: String,
        /// Name of the pose.
        pose: String,
        /// Length of the longest or shortest axis, which should be 1.
        scale: f64,
    },
    /// A matrix is a reflection.
    #[error("{file}: the pose of {pose} is mirrored: its axes are left-handed")]
    Mirror {
        /// Name of the file.
        file: String,
        /// Name of the pose.
        pose: String,
    },
    /// A matrix has shear or a last row other than 0 0 0 1, or a quaternion does not have unit length.
    #[error("{file}: the pose of {pose} is not a rotation and translation: {what}")]
    NotRigid {
        /// Name of the file.
        file: String,
        /// Name of the pose.
        pose: String,
        /// Description of the error.
        what: String,
    },
    /// The number of pose files is neither one nor the number of photos.
    #[error("{files} pose files for {photos} photos: give one for all, or one for each")]
    FileCount {
        /// Number of pose files.
        files: usize,
        /// Number of photos.
        photos: usize,
    },
    /// One of several pose files does not hold exactly one pose.
    #[error("{file} has {poses} poses; with one pose file per photo, each must have one")]
    OneEach {
        /// Name of the file.
        file: String,
        /// Number of its poses.
        poses: usize,
    },
    /// A photo has no pose.
    #[error("{file} has no pose of {photo} (poses are matched {rule})")]
    NoPose {
        /// Name of the file.
        file: String,
        /// Path of the photo.
        photo: String,
        /// Rule by which photos are matched with poses in this format.
        rule: &'static str,
    },
    /// A photo has several poses.
    #[error("{file} has several poses of {photo}")]
    Ambiguous {
        /// Name of the file.
        file: String,
        /// Path of the photo.
        photo: String,
    },
    /// Two cameras are too far apart.
    #[error(
        "according to their poses, {first} and {other} are {distance_m:.1} m apart, more than the largest room ({most_m} m); check that they are in metres"
    )]
    Distance {
        /// Path of a photo.
        first: String,
        /// Path of another.
        other: String,
        /// Distance of their cameras.
        distance_m: f64,
        /// Largest accepted distance.
        most_m: f64,
    },
    /// The format of a file with the lens of one photo is unknown.
    #[error(
        "{0}: unknown format of a lens; supported are Record3D's metadata.json, transforms.json, lightoctree's own poses, \
         frames of 3D Scanner App and Polycam, Nuke's .chan, USD as text (.usda), and COLMAP's cameras.txt \
         (lines of `CAMERA_ID MODEL WIDTH HEIGHT …`)"
    )]
    UnknownLens(String),
    /// A file has several lenses, and none has the photo's name.
    #[error("{file} has {lenses} different lenses, and none is {photo}'s by name")]
    SeveralLenses {
        /// Name of the file.
        file: String,
        /// Path of the photo.
        photo: String,
        /// Number of different lenses.
        lenses: usize,
    },
    /// The file has no lens.
    #[error("{0} has no intrinsics")]
    NoLens(String),
    /// The intrinsics are for an image of another aspect ratio.
    #[error(
        "{file}: intrinsics for {} × {} pixels, but {photo} has {} × {}: was the photo rotated or cropped?",
        stated.0, stated.1, found.0, found.1
    )]
    PictureSize {
        /// Name of the file.
        file: String,
        /// Path of the photo.
        photo: String,
        /// Width and height in the file.
        stated: (u32, u32),
        /// Width and height of the photo.
        found: (u32, u32),
    },
    /// The intrinsics are not those of a pinhole camera.
    #[error("{file}: the camera of {photo}: {source}")]
    Camera {
        /// Name of the file.
        file: String,
        /// Path of the photo.
        photo: String,
        /// Description of the error.
        source: lo_geometry::CameraError,
    },
}
