use std::path::Path;

use lo_imaging::read_regular_file;
use serde_json::Value;

use super::error::PoseError;
use super::pose_file::PoseFile;
use super::values::content;
use super::{arkit, nerf, own, record3d, tum};

/// Longest file that is read, bytes; a Record3D video of an hour has some 30 MB.
const MAX_FILE_BYTES: u64 = 48 << 20;

impl PoseFile {
    /// Reads a pose file of any format.
    ///
    /// # Errors
    /// If the file cannot be read, naming the path, and all errors of [`PoseFile::from_bytes`].
    pub fn read(path: &Path) -> Result<Self, PoseError> {
        let (text, name) = read_text(path, PoseError::Unknown)?;
        Self::from_bytes(text.as_bytes(), &name)
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

/// Reads a text file without its byte order mark, and returns its path for messages. `unknown` makes the error of files
/// that are not text.
pub(super) fn read_text(path: &Path, unknown: fn(String) -> PoseError) -> Result<(String, String), PoseError> {
    let name = path.display().to_string();
    let bytes = read_regular_file(path, MAX_FILE_BYTES);
    let bytes = bytes.map_err(|source| PoseError::Read { path: name.clone(), source })?;
    let text = String::from_utf8(bytes).map_err(|_| unknown(name.clone()))?;
    Ok((text.strip_prefix('\u{feff}').map(str::to_owned).unwrap_or(text), name))
}
