//! Reading of regular files up to a size limit.

use std::fs::File;
use std::io::{Error, ErrorKind, Read};
use std::path::Path;

/// Opens a regular file of at most `limit` bytes and returns it with its length.
///
/// Devices, pipes and sockets are refused before they are opened, because they may be endless or block.
///
/// # Errors
/// If the file cannot be opened, is not a regular file, or is longer than `limit`.
pub fn open_regular_file(path: impl AsRef<Path>, limit: u64) -> Result<(File, u64), Error> {
    let path = path.as_ref();
    // Opening a pipe waits for its other end, so the kind of file is checked first.
    check_kind(&std::fs::metadata(path)?)?;
    let file = File::open(path)?;
    let metadata = file.metadata()?;
    check_kind(&metadata)?;
    if metadata.len() > limit {
        return Err(too_large(metadata.len(), limit));
    }
    Ok((file, metadata.len()))
}

/// Reads a regular file of at most `limit` bytes.
///
/// # Errors
/// Those of [`open_regular_file`], and errors of reading.
pub fn read_regular_file(path: impl AsRef<Path>, limit: u64) -> Result<Vec<u8>, Error> {
    let (file, length) = open_regular_file(path, limit)?;
    let mut bytes = Vec::with_capacity(length as usize);
    // A file can grow while it is read, and files of /proc state a length of 0.
    file.take(limit.saturating_add(1)).read_to_end(&mut bytes)?;
    if bytes.len() as u64 > limit {
        return Err(too_large(bytes.len() as u64, limit));
    }
    Ok(bytes)
}

/// Reads a regular text file of at most `limit` bytes.
///
/// # Errors
/// Those of [`read_regular_file`], and [`ErrorKind::InvalidData`] for text that is not UTF-8.
pub fn read_regular_text(path: impl AsRef<Path>, limit: u64) -> Result<String, Error> {
    String::from_utf8(read_regular_file(path, limit)?)
        .map_err(|error| Error::new(ErrorKind::InvalidData, format!("the text is not UTF-8: {error}")))
}

fn check_kind(metadata: &std::fs::Metadata) -> Result<(), Error> {
    if metadata.is_dir() {
        Err(ErrorKind::IsADirectory.into())
    } else if metadata.is_file() {
        Ok(())
    } else {
        Err(Error::new(ErrorKind::InvalidInput, "it is a device, pipe or socket; only regular files are read"))
    }
}

fn too_large(bytes: u64, limit: u64) -> Error {
    Error::new(ErrorKind::FileTooLarge, format!("the file is too large: {bytes} bytes, the limit is {limit}"))
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn regular_files_up_to_the_limit_are_read() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.txt");
        std::fs::write(&path, "photo").unwrap();
        assert_eq!(read_regular_file(&path, 5).unwrap(), b"photo");
        assert_eq!(read_regular_text(&path, 5).unwrap(), "photo");
        let error = read_regular_file(&path, 4).unwrap_err();
        assert_eq!(error.to_string(), "the file is too large: 5 bytes, the limit is 4");
        assert_eq!(read_regular_file(folder.path(), 4).unwrap_err().kind(), ErrorKind::IsADirectory);
        assert_eq!(read_regular_file(folder.path().join("none"), 4).unwrap_err().kind(), ErrorKind::NotFound);
        std::fs::write(&path, b"\xff").unwrap();
        assert!(read_regular_text(&path, 5).unwrap_err().to_string().contains("not UTF-8"));
    }

    #[cfg(unix)]
    #[test]
    fn devices_and_pipes_are_refused_without_reading() {
        let folder = tempfile::tempdir().unwrap();
        let pipe = folder.path().join("pipe");
        let made = std::process::Command::new("mkfifo").arg(&pipe).status().unwrap();
        assert!(made.success());
        let link = folder.path().join("link");
        std::os::unix::fs::symlink("/dev/zero", &link).unwrap();
        for path in [&pipe, &link, Path::new("/dev/zero")] {
            let error = read_regular_file(path, u64::MAX).unwrap_err().to_string();
            assert_eq!(error, "it is a device, pipe or socket; only regular files are read", "{}", path.display());
        }
        // The length of such files is 0 in their metadata.
        #[cfg(target_os = "linux")]
        assert!(read_regular_file("/proc/cpuinfo", 8).unwrap_err().to_string().contains("too large: 9 bytes"));
    }
}
