use std::path::Path;

use lo_imaging::read_regular_file;
use serde_json::Value;

use super::error::PoseError;
use super::pose_file::PoseFile;
use super::values::content;
use super::{arkit, chan, colmap_images, nerf, own, record3d, tum, usd};

/// Longest file that is read, bytes; a Record3D video of an hour has some 30 MB.
const MAX_FILE_BYTES: u64 = 48 << 20;

impl PoseFile {
    /// Reads a pose file of any format, or the folder of a COLMAP model. COLMAP's lenses are read from `cameras.txt`
    /// beside `images.txt`.
    ///
    /// # Errors
    /// If a file cannot be read, naming its path, a COLMAP model is binary, and all errors of [`PoseFile::from_bytes`].
    pub fn read(path: &Path) -> Result<Self, PoseError> {
        let path = &colmap_images::file_of_model(path)?;
        let (text, name) = if path.file_name().is_some_and(|name| name == "images.txt") {
            let name = path.display().to_string();
            let text = colmap_images::read_text(path);
            (text.map_err(|source| PoseError::Read { path: name.clone(), source })?, name)
        } else {
            read_text(path, PoseError::Unknown)?
        };
        Self::from_text(&text, &name, || read_text(&path.with_file_name("cameras.txt"), PoseError::Unknown).map(Some))
    }

    /// Parses a pose file. `name` appears in errors, and its extension tells `.chan` from TUM trajectories. COLMAP's
    /// `images.txt` gives poses without lenses.
    ///
    /// # Errors
    /// If the format is unknown or binary, a pose is not a rigid transform, or intrinsics are not numbers.
    pub fn from_bytes(bytes: &[u8], name: &str) -> Result<Self, PoseError> {
        refuse_binary_usd(bytes, name)?;
        let text = std::str::from_utf8(bytes).map_err(|_| PoseError::Unknown(name.to_owned()))?;
        Self::from_text(text.strip_prefix('\u{feff}').unwrap_or(text), name, || Ok(None))
    }

    /// Parses a pose file. `cameras` reads COLMAP's `cameras.txt`, and returns its text and name.
    fn from_text(
        text: &str,
        name: &str,
        cameras: impl FnOnce() -> Result<Option<(String, String)>, PoseError>,
    ) -> Result<Self, PoseError> {
        let unknown = || PoseError::Unknown(name.to_owned());
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
        } else if text.starts_with("#usda") {
            usd::read(text, name)?
        } else if chan::is_track(text, name) {
            chan::read(text, name)?
        } else if colmap_images::is_images(text) {
            colmap_images::read(text, name, cameras()?)?
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
    refuse_binary_usd(&bytes, &name)?;
    let text = String::from_utf8(bytes).map_err(|_| unknown(name.clone()))?;
    Ok((text.strip_prefix('\u{feff}').map(str::to_owned).unwrap_or(text), name))
}

/// Returns an error if bytes are a `.usdc` (OpenUSD's crate format), or a `.usdz` by the name.
fn refuse_binary_usd(bytes: &[u8], name: &str) -> Result<(), PoseError> {
    let is_archive = bytes.starts_with(b"PK\x03\x04") && name.to_ascii_lowercase().ends_with(".usdz");
    match bytes.starts_with(b"PXR-USDC") || is_archive {
        true => Err(PoseError::UsdBinary(name.to_owned())),
        false => Ok(()),
    }
}
