//! Published encoder weights: provenance and file reading.

use std::path::Path;

use lo_nets::checkpoint::Checkpoint;
use lo_nets::depth::EncoderKind;
use pytorch_reader::{DType, PytorchReader, Tensor};
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};

use crate::error::TrainError;

/// Provenance of an encoder's initial weights.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct EncoderOrigin {
    /// Name of the file.
    pub file: String,
    /// SHA-256 of the file, hexadecimal.
    pub sha256: String,
}

/// Returns the name of an encoder's published weights file and the prefix of its SHA-256.
///
/// torchvision publishes eight digits, the others all 64.
pub fn published(encoder: EncoderKind) -> (&'static str, &'static str) {
    match encoder {
        EncoderKind::DenseNet121 => ("densenet121-a639ec97.pth", "a639ec97"),
        EncoderKind::EfficientNetLite0 => {
            ("efficientnet-lite0-57934424.pth", "579344248a93e23026e6b78f1f6faf0bc1d282386f6c881cdbaacd49cabf77db")
        }
        EncoderKind::EfficientNetLite2 => {
            ("efficientnet-lite2-9656183e.pth", "9656183eaeafe8cbf0cf560089305d34668787f6a26377ccbe5be192ed3f855d")
        }
    }
}

impl EncoderOrigin {
    /// Returns whether the file is the [published] one, bit for bit. A converted file is not.
    pub fn is_published(&self, encoder: EncoderKind) -> bool {
        self.sha256.starts_with(published(encoder).1)
    }
}

/// Reads weights under their published names from a `.safetensors` file or a `torch.save` file (`.pth`, `.pt`).
///
/// Code in pickled files is not executed.
///
/// # Errors
/// Unreadable files, and a file with the name but not the contents of the [published] one.
pub fn read_encoder(path: &Path, encoder: EncoderKind) -> Result<(Checkpoint, EncoderOrigin), TrainError> {
    let bytes = std::fs::read(path).map_err(TrainError::io(path))?;
    let sha256 = Sha256::digest(&bytes).iter().map(|byte| format!("{byte:02x}")).collect();
    let file = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
    let origin = EncoderOrigin { file, sha256 };
    let wrong = |reason: String| TrainError::EncoderWeights { path: path.to_owned(), reason };
    let (name, prefix) = published(encoder);
    if origin.file == name && !origin.is_published(encoder) {
        let EncoderOrigin { sha256, .. } = origin;
        return Err(wrong(format!("damaged, or not the published file: its SHA-256 is {sha256}, expected {prefix}")));
    }
    let is_safetensors = path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("safetensors"));
    let weights = if is_safetensors {
        Checkpoint::from_bytes(&bytes, &path.display().to_string())?
    } else {
        drop(bytes);
        let reader = PytorchReader::new(path).map_err(|error| wrong(error.to_string()))?;
        let mut weights = Checkpoint::default();
        for (name, tensor) in reader.tensors() {
            if let Some(values) = floats(tensor).map_err(|error| wrong(format!("tensor \"{name}\": {error}")))? {
                weights.insert(name, tensor.shape(), values);
            }
        }
        weights
    };
    Ok((weights, origin))
}

/// Reads a tensor as floats; `None` for integers such as `num_batches_tracked`.
fn floats(tensor: &Tensor) -> Result<Option<Vec<f32>>, String> {
    let read = || tensor.read().map_err(|error| error.to_string());
    Ok(Some(match tensor.dtype() {
        DType::F32 => read()?.as_chunks::<4>().0.iter().map(|&b| f32::from_le_bytes(b)).collect(),
        DType::F64 => read()?.as_chunks::<8>().0.iter().map(|&b| f64::from_le_bytes(b) as f32).collect(),
        DType::I64 | DType::I32 | DType::I16 | DType::I8 | DType::U8 | DType::Bool => return Ok(None),
        other => return Err(format!("its data type is {other:?}; F32 or F64 is required")),
    }))
}
