use std::path::PathBuf;

/// Errors of generating a room.
#[derive(Debug, thiserror::Error)]
pub enum SynthError {
    /// A field of the config has an invalid value.
    #[error("field `{field}` of the room config {what}")]
    Config {
        /// Name of the field.
        field: String,
        /// The problem with its value.
        what: String,
    },
    /// The folder of outdoor panoramas cannot be listed.
    #[error("cannot list the folder of outdoor panoramas {}: {source}", path.display())]
    Folder {
        /// The folder.
        path: PathBuf,
        /// The system's error.
        source: std::io::Error,
    },
    /// The folder of outdoor panoramas holds no `.hdr` or `.exr` file.
    #[error("no .hdr or .exr panorama in {}", path.display())]
    NoPanorama {
        /// The folder.
        path: PathBuf,
    },
    /// A picture folder cannot be listed.
    #[error("cannot list the picture folder {}: {source}", path.display())]
    PictureFolder {
        /// The folder.
        path: PathBuf,
        /// The system's error.
        source: std::io::Error,
    },
    /// A picture folder holds no readable image.
    #[error("no image (.jpg, .jpeg, .png, .webp, .hdr, .exr) in the picture folder {}", path.display())]
    NoPicture {
        /// The folder.
        path: PathBuf,
    },
    /// An image of a picture folder cannot be read.
    #[error("cannot read an image of a picture folder: {0}")]
    Picture(lo_imaging::ImageError),
    /// An outdoor panorama cannot be read.
    #[error("cannot read an outdoor panorama: {0}")]
    Panorama(#[from] lo_imaging::ImageError),
    /// An outdoor panorama is not twice as wide as high.
    #[error("{} is {width} × {height} pixels; equirectangular panoramas are twice as wide as high", path.display())]
    NotEquirectangular {
        /// The file.
        path: PathBuf,
        /// Width in pixels.
        width: usize,
        /// Height in pixels.
        height: usize,
    },
}
