//! Real files for tests: those of the repository, which every clone has, and those that may lie beside the checkout.

use std::io::Write;
use std::path::{Path, PathBuf};

/// A real photo (1920 × 1440, sRGB, no EXIF), its LiDAR depth (256 × 192, 16 bits, millimetres) and a mesh (glTF binary):
/// `library_color.jpg`, `library_lidar_depth.png`, `suzanne.glb`. The program carries them; their licences are beside them.
pub fn asset(name: &str) -> PathBuf {
    let folder = if name.ends_with(".glb") { "crates/lightoctree/models" } else { "apps/lightoctree-cli/assets" };
    root().join(folder).join(name)
}

/// The folder of one real HDR panorama: `lebombo_256.hdr`, 256 × 128, a room with a sunlit window. Its licence is beside it.
pub fn panoramas() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("files")
}

/// A file or folder of `shared/data` beside the checkout. Where it is missing, stderr names it and what is not tested therefore,
/// past the test harness, which keeps what passing tests print.
pub fn beside(path: &str, untested: &str) -> Option<PathBuf> {
    let path = root().join("../shared/data").join(path);
    if path.exists() {
        return Some(path);
    }
    // A closed stderr is no reason to fail.
    let _ = writeln!(std::io::stderr().lock(), "\nSKIPPED: {untested}: there is no {}", path.display());
    None
}

/// The checkout.
fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../..").canonicalize().expect("a crate lies in its checkout")
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
    fn what_is_missing_is_said_and_none() {
        assert_eq!(beside("no/such/file", "nothing: this line is a test's own"), None);
    }
}
