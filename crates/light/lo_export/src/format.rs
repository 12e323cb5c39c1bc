use std::fmt;
use std::str::FromStr;

use crate::ExportError;

/// Format of an exported file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Format {
    /// Point cloud, binary little-endian.
    Ply,
    /// glTF 2.0 binary: the visible faces of the leaves, or points; camera; lamps.
    Glb,
    /// USD as text: points, camera, dome light, lamps.
    Usda,
    /// USD package for AR Quick Look: the meshes with textures of eight bits, always level if gravity is known.
    Usdz,
}

impl Format {
    /// All formats.
    pub const ALL: [Self; 4] = [Self::Ply, Self::Glb, Self::Usda, Self::Usdz];

    /// Returns whether the format stores lamps.
    pub fn has_lamps(self) -> bool {
        matches!(self, Self::Glb | Self::Usda)
    }
}

impl fmt::Display for Format {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Ply => "ply",
            Self::Glb => "glb",
            Self::Usda => "usda",
            Self::Usdz => "usdz",
        })
    }
}

impl FromStr for Format {
    type Err = ExportError;

    fn from_str(name: &str) -> Result<Self, ExportError> {
        let known = Self::ALL.into_iter().find(|format| name.eq_ignore_ascii_case(&format.to_string()));
        known.ok_or_else(|| ExportError::UnknownFormat(name.to_owned()))
    }
}
