use std::fs::File;
use std::io::{self, BufWriter, Write};
use std::path::Path;

/// Writes a file that appears whole or not at all: into a temporary file beside `path`, renamed when `write` succeeds.
///
/// An existing file is replaced. Errors of the file system name the path.
pub fn write_atomically<T, E: From<io::Error>>(
    path: &Path,
    write: impl FnOnce(&mut BufWriter<&mut File>) -> Result<T, E>,
) -> Result<T, E> {
    replace_when_written(path, write, |error| {
        E::from(io::Error::new(error.kind(), format!("{}: {error}", path.display())))
    })
}

/// As [`write_atomically`], with `named` to make what the caller needs of the file system's errors.
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
    // what an ordinary file would get; the umask applies
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
