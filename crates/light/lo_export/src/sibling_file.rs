//! Names of the files beside the exported scene.

use std::path::{Path, PathBuf};

use crate::ExportError;

/// A file beside the exported scene.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct SiblingFile {
    /// Path of the file.
    pub path: PathBuf,
    /// File name without folder, as the scene file refers to it.
    pub name: String,
}

impl SiblingFile {
    /// Names it `<stem of scene>_<ending>`.
    ///
    /// # Errors
    /// If the scene's name cannot be used in a text file.
    pub fn new(scene: &Path, ending: &str) -> Result<Self, ExportError> {
        let stem = scene.file_stem().and_then(|stem| stem.to_str()).filter(|stem| !stem.contains(char::is_control));
        let name = format!("{}_{ending}", stem.ok_or_else(|| ExportError::UnusableStem(scene.to_owned()))?);
        Ok(Self { path: scene.with_file_name(&name), name })
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn the_file_lies_beside_the_scene() {
        let file = SiblingFile::new(Path::new("folder/my room.x"), "probe.exr").unwrap();
        assert_eq!(file.path, Path::new("folder/my room_probe.exr"));
        assert_eq!(file.name, "my room_probe.exr");
        assert!(matches!(SiblingFile::new(Path::new("a\nb.ply"), "x"), Err(ExportError::UnusableStem(_))));
    }
}
