//! Arrays in HDF5 files.

use std::path::Path;

use half::f16;
use hdf5_pure::{Datatype, DatatypeByteOrder, File};

use crate::DatasetError;

/// Name of the one array of a file.
const ARRAY: &str = "dataset";

/// Most values of an array: an image of 8192 × 8192 pixels.
const MAX_VALUES: u64 = 3 << 26;

/// Reads the array `dataset` of a file: its dimensions, and its values in row-major order.
///
/// # Errors
/// Unreadable files; arrays that are too large, or not of floating-point numbers of 16, 32 or 64 bits.
pub(super) fn read_array(path: &Path) -> Result<(Vec<usize>, Vec<f64>), DatasetError> {
    let failed = |error: hdf5_pure::Error| DatasetError::field(path, ARRAY, error);
    let array = File::open(path).and_then(|file| file.dataset(ARRAY)).map_err(failed)?;
    let shape = array.shape().map_err(failed)?;
    let count = shape.iter().try_fold(1u64, |count, &size| count.checked_mul(size));
    let count = count.filter(|&count| count <= MAX_VALUES);
    let count = count.ok_or_else(|| DatasetError::field(path, ARRAY, format!("{shape:?} values are too many")))?;
    let bytes = match array.datatype().map_err(failed)? {
        Datatype::FloatingPoint { size, byte_order: DatatypeByteOrder::LittleEndian, .. } => {
            array.read_raw().map_err(failed).map(|bytes| (bytes, size))
        }
        other => Err(DatasetError::field(
            path,
            ARRAY,
            format!("little-endian floating-point numbers are needed, not {other:?}"),
        )),
    };
    let (bytes, size) = bytes?;
    let values: Vec<f64> = match size {
        2 => bytes.as_chunks().0.iter().map(|&bytes| f16::from_le_bytes(bytes).to_f64()).collect(),
        4 => bytes.as_chunks().0.iter().map(|&bytes| f32::from_le_bytes(bytes).into()).collect(),
        8 => bytes.as_chunks().0.iter().map(|&bytes| f64::from_le_bytes(bytes)).collect(),
        _ => return Err(DatasetError::field(path, ARRAY, format!("numbers of {size} bytes are not read"))),
    };
    if values.len() as u64 != count {
        return Err(DatasetError::field(path, ARRAY, format!("{} values for {shape:?}", values.len())));
    }
    Ok((shape.into_iter().map(|size| size as usize).collect(), values))
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn arrays_of_other_writers_are_read() {
        // By h5py: tests/fixtures/make_half.py.
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/fixtures/half.hdf5");
        let (shape, values) = read_array(&path).unwrap();
        assert_eq!(shape, [6, 8]);
        assert!(values[1].is_nan());
        let others = values.iter().enumerate().filter(|&(index, _)| index != 1);
        assert!(others.into_iter().all(|(index, &value)| value == index as f64 / 4.0 - 3.0), "{values:?}");
    }

    #[test]
    fn other_files_are_refused() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.hdf5");
        for bytes in [&b""[..], b"\x89HDF\r\n\x1a\n", &[0; 600]] {
            std::fs::write(&path, bytes).unwrap();
            let error = read_array(&path).unwrap_err().to_string();
            assert!(error.starts_with(&format!("{}: dataset: ", path.display())), "{error}");
        }
        assert!(read_array(folder.path()).is_err() && read_array(&folder.path().join("gone")).is_err());
    }
}
