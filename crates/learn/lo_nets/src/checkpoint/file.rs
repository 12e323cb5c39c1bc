//! File format of checkpoints.

use std::io::{Read, Write};
use std::path::Path;

use half::slice::HalfFloatSliceExt;
use safetensors::tensor::{Dtype, Metadata, TensorInfo, TensorView};

use super::{Checkpoint, CheckpointError, Precision, StoredTensor};

/// Version of the file format.
pub const FORMAT_VERSION: u64 = 1;

/// Largest file. A checkpoint of the paper's networks has 0.3 GB.
const MAX_BYTES: u64 = 4 << 30;

impl Checkpoint {
    /// Writes the file atomically.
    ///
    /// # Errors
    /// Errors of the file system.
    pub fn write(&self, path: impl AsRef<Path>, precision: Precision) -> Result<(), CheckpointError> {
        let path = path.as_ref();
        let dtype = if precision == Precision::Full { Dtype::F32 } else { Dtype::F16 };
        let bytes: Vec<(&String, &StoredTensor, Vec<u8>)> = self
            .tensors
            .iter()
            .map(|(name, tensor)| {
                let bytes = match precision {
                    Precision::Full => tensor.values.iter().flat_map(|v| v.to_le_bytes()).collect(),
                    Precision::Half => {
                        tensor.values.iter().flat_map(|&v| half::f16::from_f32(v).to_le_bytes()).collect()
                    }
                };
                (name, tensor, bytes)
            })
            .collect();
        let views = bytes.iter().map(|(name, tensor, bytes)| {
            (*name, TensorView::new(dtype, tensor.shape.clone(), bytes).expect("bytes match the shape"))
        });
        let metadata = serde_json::json!({ "format_version": FORMAT_VERSION, "state": self.state }).to_string();
        let file = safetensors::serialize(views, Some([("checkpoint".to_owned(), metadata)].into()))
            .map_err(|error| content(path, error))?;
        lo_imaging::write_atomically(path, |out| out.write_all(&file))
            .map_err(|source| CheckpointError::File { path: path.display().to_string(), source })
    }

    /// Rounds all values to what a file of [`Precision::Half`] would return.
    pub fn round_to_half(&mut self) {
        let values = self.tensors.values_mut().flat_map(|tensor| &mut tensor.values);
        values.for_each(|value| *value = half::f16::from_f32(*value).to_f32());
    }

    /// Reads a file written by [`Checkpoint::write`], or third-party weights.
    ///
    /// # Errors
    /// Files that are unreadable, damaged, or hold other number types than F32, F16, BF16 and F64. Integers are
    /// ignored.
    pub fn read(path: impl AsRef<Path>) -> Result<Self, CheckpointError> {
        let path = path.as_ref();
        let system = |source| CheckpointError::File { path: path.display().to_string(), source };
        let (file, length) = lo_imaging::open_regular_file(path, MAX_BYTES).map_err(system)?;
        Self::from_reader(file, length, path)
    }

    /// Reads a checkpoint from memory. Error messages use `name` as the path.
    ///
    /// # Errors
    /// As [`Checkpoint::read`].
    pub fn from_bytes(bytes: &[u8], name: &str) -> Result<Self, CheckpointError> {
        Self::from_reader(bytes, bytes.len() as u64, name.as_ref())
    }

    fn from_reader(mut file: impl Read, length: u64, path: &Path) -> Result<Self, CheckpointError> {
        let system = |source| CheckpointError::File { path: path.display().to_string(), source };
        let mut header_length = [0; 8];
        if length < 8 {
            return Err(content(path, "not a .safetensors file: it is shorter than eight bytes"));
        }
        file.read_exact(&mut header_length).map_err(system)?;
        let header_length = u64::from_le_bytes(header_length);
        if header_length > length - 8 {
            return Err(content(path, "not a .safetensors file, or truncated: its header is longer than the file"));
        }
        let mut header = vec![0; header_length as usize];
        file.read_exact(&mut header).map_err(system)?;
        let header: Metadata = serde_json::from_slice(&header).map_err(|error| content(path, error))?;
        let described = 8 + header_length + header.data_len() as u64;
        if described != length {
            return Err(content(
                path,
                format!("damaged: its header describes {described} bytes, but the file has {length}"),
            ));
        }
        // Reads one tensor at a time, to avoid holding the file and the values in memory together.
        let (mut checkpoint, mut bytes) = (Self::default(), Vec::new());
        for name in header.offset_keys() {
            let Some(TensorInfo { dtype, shape, data_offsets: (begin, end) }) = header.info(&name) else { continue };
            bytes.resize(end - begin, 0);
            file.read_exact(&mut bytes).map_err(system)?;
            let values = match dtype {
                Dtype::F32 => bytes.as_chunks::<4>().0.iter().map(|&b| f32::from_le_bytes(b)).collect(),
                Dtype::F64 => bytes.as_chunks::<8>().0.iter().map(|&b| f64::from_le_bytes(b) as f32).collect(),
                Dtype::F16 => {
                    let halves: Vec<half::f16> =
                        bytes.as_chunks::<2>().0.iter().map(|&b| half::f16::from_le_bytes(b)).collect();
                    let mut values = vec![0.0; halves.len()];
                    halves.convert_to_f32_slice(&mut values);
                    values
                }
                Dtype::BF16 => {
                    bytes.as_chunks::<2>().0.iter().map(|&b| half::bf16::from_le_bytes(b).to_f32()).collect()
                }
                Dtype::I64 | Dtype::I32 => continue,
                other => {
                    return Err(content(
                        path,
                        format!("tensor \"{name}\" has the type {other:?}; only floating-point tensors are supported"),
                    ));
                }
            };
            checkpoint.tensors.insert(name, StoredTensor { shape: shape.clone(), values });
        }
        if let Some(text) = header.metadata().as_ref().and_then(|map| map.get("checkpoint")) {
            let mut json: serde_json::Value = serde_json::from_str(text).map_err(|error| content(path, error))?;
            let version = json["format_version"].as_u64();
            if version != Some(FORMAT_VERSION) {
                let found = version.map_or_else(|| "missing".to_owned(), |version| version.to_string());
                return Err(content(path, format!("format version is {found}; this program reads {FORMAT_VERSION}")));
            }
            checkpoint.state = json["state"].take();
        }
        Ok(checkpoint)
    }
}

fn content(path: &Path, reason: impl ToString) -> CheckpointError {
    CheckpointError::Content { path: path.display().to_string(), reason: reason.to_string() }
}
