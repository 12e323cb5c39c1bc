use std::path::PathBuf;

/// Why a room could not be made.
#[derive(Debug, thiserror::Error)]
pub enum SynthError {
    /// A setting that makes no sense.
    #[error("setting `{field}` {what}")]
    Config {
        /// Its name.
        field: String,
        /// What is wrong.
        what: String,
    },
    /// The folder of outdoor panoramas cannot be listed.
    #[error("cannot list the outdoor panoramas in {}: {source}", path.display())]
    Folder {
        /// The folder.
        path: PathBuf,
        /// What the system says.
        source: std::io::Error,
    },
    /// The folder has no picture of the right kind.
    #[error("{} holds no .hdr or .exr panorama", path.display())]
    NoPanorama {
        /// The folder.
        path: PathBuf,
    },
    /// A folder of pictures cannot be listed.
    #[error("cannot list the pictures in {}: {source}", path.display())]
    PictureFolder {
        /// The folder.
        path: PathBuf,
        /// What the system says.
        source: std::io::Error,
    },
    /// The folder has no picture of the right kind.
    #[error("{} holds no picture (.jpg, .jpeg, .png, .webp, .hdr, .exr)", path.display())]
    NoPicture {
        /// The folder.
        path: PathBuf,
    },
    /// A picture cannot be read.
    #[error("picture: {0}")]
    Picture(lo_imaging::ImageError),
    /// A panorama cannot be read.
    #[error("outdoor panorama: {0}")]
    Panorama(#[from] lo_imaging::ImageError),
    /// A panorama is not twice as wide as high.
    #[error("{} is {width} × {height} pixels; an equirectangular panorama is twice as wide as high", path.display())]
    NotEquirectangular {
        /// The file.
        path: PathBuf,
        /// Its width in pixels.
        width: usize,
        /// Its height in pixels.
        height: usize,
    },
}
