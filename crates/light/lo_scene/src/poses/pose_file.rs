use std::fmt;

use lo_geometry::Vec3;

use super::pose::Pose;

/// Format of a pose file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PoseFormat {
    /// lightoctree's own format.
    Own,
    /// Record3D's `metadata.json`.
    Record3d,
    /// Frames of 3D Scanner App.
    ScannerApp,
    /// Key frames of Polycam.
    Polycam,
    /// `transforms.json` of instant-ngp, nerfstudio and others.
    Nerf,
    /// A TUM trajectory.
    Tum,
    /// Nuke's `.chan`.
    Chan,
    /// COLMAP's `images.txt`.
    Colmap,
    /// The camera of a USD file in text form.
    Usd,
}

impl PoseFormat {
    /// Whether positions have a unit, the metre. COLMAP's is arbitrary: its poses need a scale from elsewhere.
    pub fn has_unit(self) -> bool {
        self != Self::Colmap
    }
}

impl fmt::Display for PoseFormat {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Own => "lightoctree's own",
            Self::Record3d => "Record3D",
            Self::ScannerApp => "3D Scanner App",
            Self::Polycam => "Polycam",
            Self::Nerf => "transforms.json",
            Self::Tum => "TUM trajectory",
            Self::Chan => "Nuke .chan",
            Self::Colmap => "COLMAP",
            Self::Usd => "USD",
        })
    }
}

/// Content of a pose file.
#[derive(Clone, Debug, PartialEq)]
pub struct PoseFile {
    /// Name of the file, for messages.
    pub name: String,
    /// Its format.
    pub format: PoseFormat,
    /// The poses in the file's order; at least one.
    pub poses: Vec<Pose>,
    /// Unit vector against gravity in the world of the poses, if the format states it.
    pub world_up: Option<Vec3>,
}
