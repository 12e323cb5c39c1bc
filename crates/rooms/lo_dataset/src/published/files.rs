//! Directory listings and panorama files.

use std::path::{Path, PathBuf};

use lo_imaging::{RadianceImage, read_radiance};

use crate::DatasetError;

/// Returns the entries of a folder sorted by name, so that a dataset's order does not depend on the file system.
pub(super) fn entries(folder: &Path) -> Result<Vec<PathBuf>, DatasetError> {
    let mut paths = Vec::new();
    for entry in std::fs::read_dir(folder).map_err(DatasetError::io(folder))? {
        paths.push(entry.map_err(DatasetError::io(folder))?.path());
    }
    paths.sort();
    Ok(paths)
}

/// Returns the subfolders of a folder, sorted by name.
pub(super) fn folders(folder: &Path) -> Result<Vec<PathBuf>, DatasetError> {
    Ok(entries(folder)?.into_iter().filter(|path| path.is_dir()).collect())
}

/// Returns the last component of a path.
pub(super) fn name(path: &Path) -> String {
    path.file_name().unwrap_or_default().to_string_lossy().into_owned()
}

/// Returns the file name without extension.
pub(super) fn stem(path: &Path) -> String {
    path.file_stem().unwrap_or_default().to_string_lossy().into_owned()
}

/// Whether the extension is that of an HDR image.
pub(super) fn is_hdr(path: &Path) -> bool {
    path.extension().is_some_and(|e| ["hdr", "exr", "pfm"].iter().any(|known| e.eq_ignore_ascii_case(known)))
}

/// Reads an equirectangular HDR map. NaN, infinite and negative values, which occur in lossy files, become 0.
///
/// # Errors
/// If the image is not twice as wide as high.
pub(super) fn read_panorama(path: &Path) -> Result<RadianceImage, DatasetError> {
    let map = read_radiance(path)?;
    if map.width() != 2 * map.height() || map.height() == 0 {
        let reason = format!("{} × {} pixels; a panorama is twice as wide as high", map.width(), map.height());
        return Err(DatasetError::field(path, "size", reason));
    }
    Ok(map.map(|rgb| rgb.map(|v| if v.is_finite() { v.max(0.0) } else { 0.0 })))
}
