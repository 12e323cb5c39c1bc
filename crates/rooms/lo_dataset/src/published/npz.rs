use std::fs::File;
use std::io::Read;
use std::path::{Path, PathBuf};

use npyz::{NpyFile, Order};
use zip::ZipArchive;

use crate::DatasetError;

/// Most values of an array.
const MAX_VALUES: u64 = 1 << 26;

/// An archive of NumPy arrays (`.npz`).
pub(super) struct Npz {
    path: PathBuf,
    archive: ZipArchive<File>,
}

impl Npz {
    pub fn open(path: &Path) -> Result<Self, DatasetError> {
        let file = File::open(path).map_err(DatasetError::io(path))?;
        let archive = ZipArchive::new(file).map_err(|error| DatasetError::field(path, "archive", error))?;
        Ok(Self { path: path.to_owned(), archive })
    }

    /// Reads an array of floats or bytes in C order: its values, and the sizes of its `N` dimensions without a first
    /// one of 1, which stands for the batch.
    pub fn array<const N: usize>(&mut self, name: &str) -> Result<(Vec<f32>, [usize; N]), DatasetError> {
        let Self { path, archive } = self;
        let wrong = |reason: String| DatasetError::field(path, name, reason);
        let member = archive.by_name(&format!("{name}.npy")).map_err(|error| wrong(error.to_string()))?;
        let array = NpyFile::new(member).map_err(|error| wrong(error.to_string()))?;
        let count = array.shape().iter().try_fold(1u64, |count, &size| count.checked_mul(size));
        if array.order() != Order::C || count.is_none_or(|count| count > MAX_VALUES) {
            return Err(wrong(format!("an array of {:?} in C order is expected", array.shape())));
        }
        let shape = array.shape().strip_prefix(&[1]).unwrap_or(array.shape());
        let sizes: Vec<usize> = shape.iter().map(|&size| size as usize).collect();
        let values = floats(array).map_err(wrong)?;
        let sizes = <[usize; N]>::try_from(&sizes[..])
            .map_err(|_| wrong(format!("shape {sizes:?}; {N} dimensions are expected")))?;
        Ok((values, sizes))
    }
}

fn floats(array: NpyFile<impl Read>) -> Result<Vec<f32>, String> {
    let text = |error: std::io::Error| error.to_string();
    let array = match array.try_data::<f32>() {
        Ok(values) => return values.collect::<Result<_, _>>().map_err(text),
        Err(array) => array,
    };
    let array = match array.try_data::<f64>() {
        Ok(values) => {
            return values.map(|value| value.map(|value| value as f32)).collect::<Result<_, _>>().map_err(text);
        }
        Err(array) => array,
    };
    match array.try_data::<u8>() {
        Ok(values) => values.map(|value| value.map(f32::from)).collect::<Result<_, _>>().map_err(text),
        Err(array) => Err(format!("data type {}; f4, f8 or u1 is expected", array.dtype().descr())),
    }
}
