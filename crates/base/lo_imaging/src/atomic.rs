use std::fs::File;
use std::io::{self, BufWriter, Write};
use std::path::Path;

use tempfile::NamedTempFile;

/// Writes a file atomically: into a temporary file beside `path`, which is renamed when `write` succeeds.
///
/// An existing file is replaced.
///
/// # Errors
/// Errors of `write`, and I/O errors, whose message names the path.
pub fn write_atomically<T, E: From<io::Error>>(
    path: &Path,
    write: impl FnOnce(&mut BufWriter<&mut File>) -> Result<T, E>,
) -> Result<T, E> {
    replace_when_written(path, write, |error| {
        E::from(io::Error::new(error.kind(), format!("{}: {error}", path.display())))
    })
}

/// Creates a temporary file in the folder of `path`, with the permissions of an ordinary file: the umask applies.
///
/// # Errors
/// If the folder cannot be written.
pub fn temporary_beside(path: &Path) -> io::Result<NamedTempFile> {
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let mut builder = tempfile::Builder::new();
    builder.prefix(".lightoctree-");
    #[cfg(unix)]
    builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o666));
    builder.tempfile_in(folder)
}

/// Like [`write_atomically`], with `named` to convert I/O errors.
pub(crate) fn replace_when_written<T, E>(
    path: &Path,
    write: impl FnOnce(&mut BufWriter<&mut File>) -> Result<T, E>,
    named: impl Fn(io::Error) -> E,
) -> Result<T, E> {
    let mut temporary = temporary_beside(path).map_err(&named)?;
    let mut out = BufWriter::with_capacity(1 << 16, temporary.as_file_mut());
    let result = write(&mut out)?;
    out.flush().map_err(&named)?;
    drop(out);
    temporary.persist(path).map_err(|e| named(e.error))?;
    Ok(result)
}
