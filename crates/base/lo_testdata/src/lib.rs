//! Real files for tests: those in the repository, and optional ones in `shared/data` beside the checkout.

use std::io::Write;
use std::path::{Path, PathBuf};

/// Returns the path of an asset that the program embeds.
///
/// - `library_color.jpg`: a real photo (1920 × 1440, sRGB, no EXIF);
/// - `library_lidar_depth.png`: its LiDAR depth (256 × 192, 16 bits, millimetres);
/// - `suzanne.glb`: a mesh (binary glTF).
///
/// Their licences are beside them.
pub fn asset(name: &str) -> PathBuf {
    let folder = if name.ends_with(".glb") { "crates/lightoctree/models" } else { "apps/lightoctree-cli/assets" };
    root().join(folder).join(name)
}

/// Returns the folder of one real HDR panorama, `lebombo_256.hdr`: 256 × 128, a room with a sunlit window.
///
/// Its licence is beside it.
pub fn panoramas() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("files")
}

/// Returns a file or folder in `shared/data` beside the checkout; `None` if it is missing.
///
/// A missing path is reported on stderr with the skipped test, bypassing the harness, which captures the output of
/// passing tests.
pub fn shared_data(path: &str, untested: &str) -> Option<PathBuf> {
    let path = root().join("../shared/data").join(path);
    if path.exists() {
        return Some(path);
    }
    // A closed stderr is no reason to fail.
    let _ = writeln!(std::io::stderr().lock(), "\nSKIPPED: {untested}: {} does not exist", path.display());
    None
}

/// Returns all real photos: the repository's, and those beside the checkout.
///
/// # Panics
/// If a folder cannot be read.
pub fn real_photos(untested: &str) -> Vec<PathBuf> {
    let is_photo = |path: &PathBuf| {
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        !name.contains("depth") && (name.ends_with(".jpg") || name.ends_with(".png"))
    };
    let mut photos = vec![asset("library_color.jpg")];
    photos.extend(files_of(&["rgbd", "rgbd_more", "photos_more"], untested).filter(is_photo));
    photos
}

/// Returns real HDR panoramas: the repository's, and those in `folders` beside the checkout.
///
/// # Panics
/// If a folder cannot be read.
pub fn real_panoramas(folders: &[&str], untested: &str) -> Vec<PathBuf> {
    let is_panorama = |path: &PathBuf| path.extension().is_some_and(|e| e == "hdr" || e == "exr");
    let mut panoramas = vec![panoramas().join("lebombo_256.hdr")];
    panoramas.extend(files_of(folders, untested).filter(is_panorama));
    panoramas
}

/// Lists the files of folders beside the checkout.
fn files_of(folders: &[&str], untested: &str) -> impl Iterator<Item = PathBuf> {
    let folders = folders.iter().filter_map(move |folder| shared_data(folder, untested));
    let entries = folders.flat_map(|folder| std::fs::read_dir(folder).expect("a folder of test data can be read"));
    entries.map(|entry| entry.expect("a file of test data can be listed").path())
}

/// Root of the checkout.
fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../..").canonicalize().expect("the crate is inside its checkout")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_of_the_repository_are_there() {
        let files = ["library_color.jpg", "library_lidar_depth.png", "suzanne.glb"].map(asset);
        assert!(files.iter().all(|file| file.is_file()), "{files:?}");
        assert!(panoramas().join("lebombo_256.hdr").is_file());
    }

    #[test]
    fn missing_files_are_reported_and_none() {
        assert_eq!(shared_data("no/such/file", "nothing: this line is a test's own"), None);
    }
}
