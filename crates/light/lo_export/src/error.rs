use std::path::PathBuf;

use crate::Content;

/// Why a scene cannot be exported.
#[derive(Debug, thiserror::Error)]
pub enum ExportError {
    /// The name is none of a format.
    #[error("unknown export format {0:?}; known are ply, glb and usda")]
    UnknownFormat(String),
    /// There is nothing to write.
    #[error("{}", match .0 {
        Content::Leaves => "the scene's octree has no visible node with radiance; there is nothing to export",
        Content::PhotoPoints => "the scene's depth map has no reading; there are no photo points to export",
    })]
    Nothing(Content),
    /// A value is NaN or infinite.
    #[error("the {value} of {what} {index} is not finite; the scene is damaged", what = match .content {
        Content::Leaves => "leaf",
        Content::PhotoPoints => "photo point",
    })]
    NotFinite {
        /// What was exported.
        content: Content,
        /// Position among the points, from 0.
        index: usize,
        /// Which of its values.
        value: &'static str,
    },
    /// glTF binaries end at 4 GiB.
    #[error("the scene needs {bytes} bytes as a glTF binary, which can hold 4 GiB at most; export it as ply or usda")]
    TooLarge {
        /// Size that the file would have.
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
    /// The output's name has no file name to derive those of the files beside it from.
    #[error("{0} does not name a file in Unicode, which other programs' references to the files beside it need")]
    UnusableStem(PathBuf),
    /// Nothing says which way is up.
    #[error(
        "the scene does not know which way is up, so it cannot be levelled; estimate it with depth, or export it without --level"
    )]
    NoGravity,
    /// The probe's position is not a point.
    #[error("the light probe's position {0:?} m is not finite")]
    ProbePosition([f32; 3]),
    /// The probe cannot be written.
    #[error(transparent)]
    Image(#[from] lo_imaging::ImageError),
    /// The scene cannot be written; the message names the file.
    #[error(transparent)]
    Io(#[from] std::io::Error),
}
