//! Tensors of scene files.

use std::borrow::Cow;

use half::f16;
use lo_imaging::Image;
use lo_octree::NamedTensor;
use safetensors::{Dtype, SafeTensors, View};

use crate::{PanoramaImage, SceneError};

/// Returns type, shape and bytes. The safetensors crate has checked that the number of bytes fits type and shape.
pub(crate) fn tensor<'data>(
    tensors: &SafeTensors<'data>,
    name: &'static str,
) -> Result<(Dtype, Vec<usize>, &'data [u8]), SceneError> {
    let view = tensors.tensor(name).map_err(|_| SceneError::MissingTensor(name))?;
    Ok((view.dtype(), view.shape().to_vec(), view.data()))
}

pub(crate) fn layout(tensor: &'static str, expected: &'static str, dtype: Dtype, shape: &[usize]) -> SceneError {
    SceneError::Layout { tensor, expected, got: format!("{dtype} {shape:?}") }
}

/// Converts little-endian bytes.
pub(crate) fn floats(bytes: &[u8]) -> Vec<f32> {
    bytes.as_chunks().0.iter().map(|&word| f32::from_le_bytes(word)).collect()
}

/// A tensor of a scene file, to be written.
pub(crate) enum Tensor<'a> {
    Octree(NamedTensor),
    Plain { dtype: Dtype, shape: Vec<usize>, bytes: Cow<'a, [u8]> },
}

impl<'a> Tensor<'a> {
    pub fn bytes(bytes: &'a [u8]) -> Self {
        Self::Plain { dtype: Dtype::U8, shape: vec![bytes.len()], bytes: Cow::Borrowed(bytes) }
    }

    /// An 8-bit image of shape `[height, width, 3]`.
    pub fn srgb8(image: &'a Image<[u8; 3]>) -> Self {
        let shape = vec![image.height(), image.width(), 3];
        Self::Plain { dtype: Dtype::U8, shape, bytes: Cow::Borrowed(image.pixels().as_flattened()) }
    }

    pub fn image(image: &PanoramaImage, scale: f32) -> Self {
        let values = image.radiance.pixels().as_flattened();
        let bytes = values.iter().flat_map(|value| f16::from_f32(value / scale).to_le_bytes()).collect();
        let shape = vec![image.radiance.height(), image.radiance.width(), 3];
        Self::Plain { dtype: Dtype::F16, shape, bytes: Cow::Owned(bytes) }
    }

    pub fn floats(shape: Vec<usize>, values: &[f32]) -> Self {
        let bytes = values.iter().flat_map(|v| v.to_le_bytes()).collect();
        Self::Plain { dtype: Dtype::F32, shape, bytes: Cow::Owned(bytes) }
    }
}

impl View for Tensor<'_> {
    fn dtype(&self) -> Dtype {
        match self {
            Self::Octree(tensor) => tensor.dtype(),
            Self::Plain { dtype, .. } => *dtype,
        }
    }

    fn shape(&self) -> &[usize] {
        match self {
            Self::Octree(tensor) => tensor.shape(),
            Self::Plain { shape, .. } => shape,
        }
    }

    fn data(&self) -> Cow<'_, [u8]> {
        match self {
            Self::Octree(tensor) => tensor.data(),
            Self::Plain { bytes, .. } => Cow::Borrowed(bytes),
        }
    }

    fn data_len(&self) -> usize {
        match self {
            Self::Octree(tensor) => tensor.data_len(),
            Self::Plain { bytes, .. } => bytes.len(),
        }
    }
}
