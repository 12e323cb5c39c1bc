//! Directory listings, checks and photos that the readers share.

use std::path::{Path, PathBuf};

use lo_geometry::{Camera, Quat, Vec3};
use lo_imaging::{Image, RadianceImage, read_radiance};
use lo_random::Stream;
use lo_sensor::PhotoSettings;

use crate::sample::Metadata;
use crate::{DatasetError, Shot};

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
    check_panorama(path, "size", &map)?;
    Ok(map.map(clean))
}

/// Returns radiance with NaN, infinite and negative values replaced by 0.
pub(super) fn clean(rgb: &[f32; 3]) -> [f32; 3] {
    rgb.map(|v| if v.is_finite() { v.max(0.0) } else { 0.0 })
}

/// Checks that an image in a field of a file is twice as wide as high.
pub(super) fn check_panorama(path: &Path, field: &str, map: &RadianceImage) -> Result<(), DatasetError> {
    if map.width() == 2 * map.height() && map.height() > 0 {
        return Ok(());
    }
    let reason = format!("{} × {} pixels; a panorama is twice as wide as high", map.width(), map.height());
    Err(DatasetError::field(path, field, reason))
}

/// Returns width and height.
pub(super) fn size<T>(image: &Image<T>) -> (usize, usize) {
    (image.width(), image.height())
}

/// Checks the size of an image against that of another one, named `what`.
pub(super) fn check_size(
    path: &Path,
    size: (usize, usize),
    what: &str,
    expected: (usize, usize),
) -> Result<(), DatasetError> {
    if size == expected {
        return Ok(());
    }
    let reason = format!("{} × {} pixels, but {what} has {} × {}", size.0, size.1, expected.0, expected.1);
    Err(DatasetError::field(path, "size", reason))
}

/// Checks that a photo of this size can be a JPEG.
pub(super) fn check_jpeg(path: &Path, image: &RadianceImage) -> Result<(), DatasetError> {
    let (width, height) = (image.width(), image.height());
    if width.max(height) <= usize::from(u16::MAX) {
        return Ok(());
    }
    Err(DatasetError::field(path, "size", format!("{width} × {height} pixels exceed the limit of JPEG")))
}

/// Takes a photo of radiance: without depth and views, at the origin of the record.
pub(super) fn photographed(
    settings: &PhotoSettings,
    seen: &RadianceImage,
    camera: Camera,
    stream: &mut Stream,
) -> Shot {
    let taken = settings.photograph(seen, &camera, stream);
    let [r, g, b] = taken.gains;
    Shot {
        position_m: Vec3::ZERO,
        rotation: Quat::IDENTITY,
        gains: taken.gains,
        camera,
        photo: taken.photo,
        jpeg: Some(taken.jpeg),
        radiance: Some(seen.map(|rgb| [rgb[0] * r, rgb[1] * g, rgb[2] * b])),
        depth_m: None,
        sensor_depth_m: None,
        normal: None,
        albedo: None,
        views: Vec::new(),
        metadata: Metadata::from_iter([("photo".to_owned(), serde_json::json!(settings))]),
    }
}
