use std::path::PathBuf;

use crate::Content;

/// Reasons why a scene cannot be exported.
#[derive(Debug, thiserror::Error)]
pub enum ExportError {
    /// The name is not that of a format.
    #[error("unknown export format {0:?}; supported are ply, glb, usda and usdz")]
    UnknownFormat(String),
    /// There is nothing to write.
    #[error("{}", match .0 {
        Content::Leaves => "the scene's octree has no visible node with radiance; there is nothing to export",
        Content::PhotoPoints => "the scene's depth map has no readings; there are no photo points to export",
    })]
    Nothing(Content),
    /// The format shows no points.
    #[error("AR Quick Look shows no points: export the leaves as usdz, or the points as usda")]
    NoPoints,
    /// A value is NaN or infinite.
    #[error("the {value} of {what} {index} is not finite; the scene is damaged", what = match .content {
        Content::Leaves => "leaf",
        Content::PhotoPoints => "photo point",
    })]
    NotFinite {
        /// Exported content.
        content: Content,
        /// Index among the points, from 0.
        index: usize,
        /// Name of the value.
        value: &'static str,
    },
    /// The file would exceed 4 GiB, the limit of glTF binaries.
    #[error("the scene needs {bytes} bytes as a glTF binary, which can hold 4 GiB at most; export it as ply or usda")]
    TooLarge {
        /// Size of the file, bytes.
        bytes: usize,
    },
    /// The probe's panorama is not twice as wide as high.
    #[error("a light probe must be twice as wide as high, got {width} × {height}")]
    ProbeSize {
        /// Width in pixels.
        width: usize,
        /// Height in pixels.
        height: usize,
    },
    /// The output's file name cannot be used in the names of further files.
    #[error(
        "the file name of {0} must be valid Unicode without control characters, because other files are named after it"
    )]
    UnusableStem(PathBuf),
    /// The up direction is unknown.
    #[error(
        "the scene's up direction is unknown, so it cannot be levelled; estimate it with depth, or export it without --level"
    )]
    NoGravity,
    /// The probe's position is not a point.
    #[error("the light probe's position {0:?} m is not finite")]
    ProbePosition([f32; 3]),
    /// The probe cannot be written.
    #[error(transparent)]
    Image(#[from] lo_imaging::ImageError),
    /// A file cannot be written; the message names it.
    #[error(transparent)]
    Io(#[from] std::io::Error),
}
