use std::fmt;
use std::path::Path;

/// Image file formats.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Format {
    /// PNG, 1 to 16 bits.
    Png,
    /// JPEG.
    Jpeg,
    /// WebP, lossy and lossless.
    WebP,
    /// TIFF, integer and float.
    Tiff,
    /// Windows bitmap.
    Bmp,
    /// GIF, first frame.
    Gif,
    /// PBM, PGM, PPM, PAM.
    Pnm,
    /// HEIC and HEIF, with HEVC.
    Heic,
    /// JPEG XL.
    JpegXl,
    /// Radiance RGBE (`.hdr`, `.pic`).
    Hdr,
    /// OpenEXR.
    Exr,
    /// Portable float map.
    Pfm,
    /// NumPy array.
    Npy,
    /// NumPy archive of arrays.
    Npz,
}

impl Format {
    /// Detects the format from the first bytes.
    pub fn from_bytes(bytes: &[u8]) -> Option<Self> {
        let starts = |magic: &[u8]| bytes.starts_with(magic);
        Some(match bytes {
            _ if starts(b"\x89PNG\r\n\x1a\n") => Self::Png,
            _ if starts(&[0xff, 0xd8, 0xff]) => Self::Jpeg,
            _ if starts(b"RIFF") && bytes.get(8..12) == Some(b"WEBP") => Self::WebP,
            _ if starts(b"II*\0") || starts(b"MM\0*") || starts(b"II+\0") || starts(b"MM\0+") => Self::Tiff,
            _ if starts(b"BM") => Self::Bmp,
            _ if starts(b"GIF8") => Self::Gif,
            [_, _, _, _, b'f', b't', b'y', b'p', ..] => Self::Heic,
            _ if starts(&[0xff, 0x0a]) || starts(b"\0\0\0\x0cJXL \r\n\x87\n") => Self::JpegXl,
            _ if starts(b"#?") => Self::Hdr,
            _ if starts(&[0x76, 0x2f, 0x31, 0x01]) => Self::Exr,
            _ if starts(b"\x93NUMPY") => Self::Npy,
            _ if starts(b"PK\x03\x04") => Self::Npz,
            [b'P', b'F' | b'f', space, ..] if space.is_ascii_whitespace() => Self::Pfm,
            [b'P', b'1'..=b'7', space, ..] if space.is_ascii_whitespace() || *space == b'#' => Self::Pnm,
            _ => return None,
        })
    }

    /// Returns the format of the extension, ignoring case.
    pub fn from_extension(path: &Path) -> Option<Self> {
        Some(match path.extension()?.to_str()?.to_ascii_lowercase().as_str() {
            "png" => Self::Png,
            "jpg" | "jpeg" => Self::Jpeg,
            "webp" => Self::WebP,
            "tif" | "tiff" => Self::Tiff,
            "bmp" => Self::Bmp,
            "gif" => Self::Gif,
            "pnm" | "pbm" | "pgm" | "ppm" | "pam" => Self::Pnm,
            "heic" | "heif" | "hif" => Self::Heic,
            "jxl" => Self::JpegXl,
            "hdr" | "pic" | "rgbe" => Self::Hdr,
            "exr" => Self::Exr,
            "pfm" => Self::Pfm,
            "npy" => Self::Npy,
            "npz" => Self::Npz,
            _ => return None,
        })
    }

    /// Detects the format from the content, else from the extension of `name`.
    pub(crate) fn detect(bytes: &[u8], name: &str) -> Option<Self> {
        Self::from_bytes(bytes).or_else(|| Self::from_extension(Path::new(name)))
    }
}

impl fmt::Display for Format {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Png => "PNG",
            Self::Jpeg => "JPEG",
            Self::WebP => "WebP",
            Self::Tiff => "TIFF",
            Self::Bmp => "BMP",
            Self::Gif => "GIF",
            Self::Pnm => "PNM",
            Self::Heic => "HEIC",
            Self::JpegXl => "JPEG XL",
            Self::Hdr => "Radiance HDR",
            Self::Exr => "OpenEXR",
            Self::Pfm => "PFM",
            Self::Npy => "NPY",
            Self::Npz => "NPZ",
        })
    }
}
