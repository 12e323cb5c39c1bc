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
