use std::fs::File;
use std::io::{self, BufWriter, Write};
use std::path::Path;

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

/// Like [`write_atomically`], with `named` to convert I/O errors.
pub(crate) fn replace_when_written<T, E>(
    path: &Path,
    write: impl FnOnce(&mut BufWriter<&mut File>) -> Result<T, E>,
    named: impl Fn(io::Error) -> E,
) -> Result<T, E> {
    let folder = match path.parent() {
        Some(parent) if !parent.as_os_str().is_empty() => parent,
        _ => Path::new("."),
    };
    let mut builder = tempfile::Builder::new();
    builder.prefix(".lightoctree-");
    // the permissions of an ordinary file; the umask applies
    #[cfg(unix)]
    builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o666));
    let mut temporary = builder.tempfile_in(folder).map_err(&named)?;
    let mut out = BufWriter::with_capacity(1 << 16, temporary.as_file_mut());
    let result = write(&mut out)?;
    out.flush().map_err(&named)?;
    drop(out);
    temporary.persist(path).map_err(|e| named(e.error))?;
    Ok(result)
}
