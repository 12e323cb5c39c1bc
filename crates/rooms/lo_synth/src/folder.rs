use std::io;
use std::path::{Path, PathBuf};

/// Lists the files of a folder with one of `extensions` (lower case), ignoring case.
///
/// The list is sorted, because the order of directory entries differs between machines.
pub(crate) fn files_in(folder: &Path, extensions: &[&str]) -> io::Result<Vec<PathBuf>> {
    let mut files = Vec::new();
    for entry in std::fs::read_dir(folder)? {
        let path = entry?.path();
        let extension = path.extension().and_then(|e| e.to_str()).unwrap_or_default().to_ascii_lowercase();
        if extensions.contains(&extension.as_str()) {
            files.push(path);
        }
    }
    files.sort();
    Ok(files)
}
