//! Pose files: the poses of several photos, as written by apps and other programs.
//!
//! All poses become transforms from a camera's axes (+X right, +Y up, looking along −Z) to one world, in metres. The
//! format is detected from the content:
//!
//! | format | detected by | camera axes | matched with photos by |
//! | --- | --- | --- | --- |
//! | lightoctree | `photos` | `axes`: `opengl` (ours) or `opencv` | `file` |
//! | Record3D `metadata.json` | `poses` | ours | the number in the photo's name |
//! | 3D Scanner App `frame_….json` | `cameraPoseARFrame` | ours (ARKit) | order, one file each |
//! | Polycam `cameras/….json` | `t_00` | ours (ARKit) | order, one file each |
//! | NeRF `transforms.json` | `frames` | ours (OpenGL) | `file_path` |
//! | TUM trajectory | lines of eight numbers | OpenCV | time stamps in the photos' names, within 20 ms; else order |
//!
//! [`PhotoPoses::read`] reads and matches.

mod arkit;
mod error;
mod matching;
mod nerf;
mod own;
mod pose;
mod record3d;
#[cfg(test)]
mod tests;
mod tum;

use std::fmt;
use std::io::Read;
use std::path::Path;

use lo_geometry::{DVec3, Vec3};
use serde_json::Value;

pub use error::PoseError;
pub use matching::PhotoPoses;
pub use pose::{Lens, Pose};

/// Longest file that is read, bytes; a Record3D video of an hour has some 30 MB.
const MAX_FILE_BYTES: u64 = 48 << 20;

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
    /// Whether the file states a lens distortion; it is not corrected.
    pub distorted: bool,
}

impl PoseFile {
    /// Reads a pose file of any format.
    ///
    /// # Errors
    /// If the file cannot be read, naming the path, and all errors of [`PoseFile::from_bytes`].
    pub fn read(path: &Path) -> Result<Self, PoseError> {
        let name = path.display().to_string();
        let io = |source| PoseError::Read { path: name.clone(), source };
        let file = std::fs::File::open(path).map_err(io)?;
        let length = file.metadata().map_err(io)?.len();
        if length > MAX_FILE_BYTES {
            return Err(PoseError::TooLarge { file: name, bytes: length, most: MAX_FILE_BYTES });
        }
        let mut bytes = Vec::with_capacity(length as usize);
        file.take(MAX_FILE_BYTES).read_to_end(&mut bytes).map_err(io)?;
        Self::from_bytes(&bytes, &name)
    }

    /// Parses a pose file; `name` appears in errors.
    ///
    /// # Errors
    /// If the format is unknown, a pose is not a rigid transform, or intrinsics are not numbers.
    pub fn from_bytes(bytes: &[u8], name: &str) -> Result<Self, PoseError> {
        let unknown = || PoseError::Unknown(name.to_owned());
        let text = std::str::from_utf8(bytes).map_err(|_| unknown())?;
        let text = text.strip_prefix('\u{feff}').unwrap_or(text);
        let file = if text.trim_start().starts_with(['{', '[']) {
            let value: Value = serde_json::from_str(text).map_err(|error| content(name, error))?;
            let has = |key: &str| value.get(key).is_some();
            match () {
                () if has("photos") => own::read(value, name)?,
                () if has("poses") => record3d::read(&value, name)?,
                () if has("frames") => nerf::read(&value, name)?,
                () if has("cameraPoseARFrame") => arkit::scanner_app(&value, name)?,
                () if has("t_00") => arkit::polycam(&value, name)?,
                () => return Err(unknown()),
            }
        } else {
            tum::read(text, name)?
        };
        if file.poses.is_empty() {
            return Err(content(name, "it has no poses"));
        }
        Ok(file)
    }
}

fn content(file: &str, what: impl ToString) -> PoseError {
    PoseError::Content { file: file.to_owned(), what: what.to_string() }
}

/// Parses a number, including one that is written as text.
fn number(value: &Value) -> Option<f64> {
    value.as_f64()
}

/// Returns all numbers of nested arrays in row-major order; `None` if there is anything else, or more than a matrix
/// has.
fn numbers(value: &Value) -> Option<Vec<f64>> {
    let mut all = Vec::new();
    for row in value.as_array()? {
        match row {
            Value::Array(row) => all.extend(row.iter().map(number).collect::<Option<Vec<f64>>>()?),
            value => all.push(number(value)?),
        }
        if all.len() > 16 {
            return None;
        }
    }
    Some(all)
}

/// Largest coordinate of a position, metres; differences of larger ones would lose precision.
const MAX_POSITION_M: f64 = 1e7;

fn checked_position(position_m: DVec3, file: &str, pose: &str) -> Result<DVec3, PoseError> {
    match position_m.to_array().into_iter().find(|v| !v.is_finite() || v.abs() > MAX_POSITION_M) {
        Some(value) => Err(PoseError::Value { file: file.to_owned(), pose: pose.to_owned(), value }),
        None => Ok(position_m),
    }
}
