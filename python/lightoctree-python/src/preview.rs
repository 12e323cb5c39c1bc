use lightoctree::imaging::{self, Image, Photo};
use pyo3::prelude::*;
use pyo3::types::PyBytes;

use crate::errors::Failure;
use crate::signature;

/// Longest side of a preview in pixels.
const LONGEST_SIDE: usize = 1024;

/// Encodes a photo as PNG for a notebook, reduced to [`LONGEST_SIDE`].
pub fn png<'py>(py: Python<'py>, photo: &Photo) -> PyResult<Bound<'py, PyBytes>> {
    let encode = || imaging::encode_photo("preview.png", &Photo::Srgb8(reduced(photo)), &signature("preview"));
    let bytes = py.detach(encode).map_err(|error| Failure::from(error).raise(py))?;
    Ok(PyBytes::new(py, &bytes))
}

fn reduced(photo: &Photo) -> Image<[u8; 3]> {
    let (width, height) = (photo.width(), photo.height());
    let longest = width.max(height);
    if longest <= LONGEST_SIDE {
        return photo.srgb8();
    }
    let side = |side: usize| (side * LONGEST_SIDE / longest).max(1);
    Photo::Linear(lo_imaging::resize(&photo.radiance(), side(width), side(height))).srgb8()
}
