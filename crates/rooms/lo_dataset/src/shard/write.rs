use std::io::{self, BufWriter, Write};
use std::path::Path;

use lo_imaging::write_atomically;

use super::pack::pack;
use crate::{DatasetError, Record};

/// Returns the file name of shard `number`: `rooms-000003.tar`.
pub fn shard_name(prefix: &str, number: usize) -> String {
    format!("{prefix}-{number:06}.tar")
}

/// Writes an archive atomically. The same records give the same bytes, since times and owners are left out. `generator`
/// names the writing program in each record.
///
/// # Errors
/// The first error of `records`, which aborts the archive, and file system errors, which name the path.
pub fn write_shard<E: From<DatasetError>>(
    path: &Path,
    records: impl Iterator<Item = Result<Record, E>>,
    generator: &str,
) -> Result<(), E> {
    let written = write_atomically(path, |out| {
        let mut archive = tar::Builder::new(out);
        for record in records {
            append(&mut archive, &record.map_err(Failure::Record)?, generator)?;
        }
        Ok::<_, Failure<E>>(archive.finish()?)
    });
    written.map_err(|failure| match failure {
        Failure::Record(error) => error,
        Failure::Io(source) => DatasetError::Io { path: path.to_owned(), source }.into(),
    })
}

enum Failure<E> {
    Record(E),
    Io(io::Error),
}

impl<E> From<io::Error> for Failure<E> {
    fn from(error: io::Error) -> Self {
        Self::Io(error)
    }
}

fn append<W: Write>(archive: &mut tar::Builder<&mut BufWriter<W>>, record: &Record, generator: &str) -> io::Result<()> {
    for (name, bytes) in pack(record, generator) {
        let mut header = tar::Header::new_ustar();
        header.set_size(bytes.len() as u64);
        header.set_mode(0o644);
        archive.append_data(&mut header, format!("{}.{name}", record.key), &bytes[..])?;
    }
    Ok(())
}
