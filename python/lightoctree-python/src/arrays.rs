//! NumPy arrays of images and tensors.

use std::sync::Arc;

use lightoctree::imaging::{Image, Photo};
use numpy::ndarray::{ArrayView, IxDyn};
use numpy::{Element, PyArray, PyArrayDyn, PyArrayMethods};
use pyo3::exceptions::PyRuntimeError;
use pyo3::prelude::*;

/// Keeps memory alive to which arrays refer.
#[pyclass(frozen)]
struct Memory {
    _owner: Arc<dyn Send + Sync>,
}

/// Returns a read-only array of memory that `owner` holds, without copying it.
///
/// `data` selects values and their shape; the last axis varies fastest.
#[allow(unsafe_code)]
pub fn view<'py, O: Send + Sync + 'static, T: Element>(
    py: Python<'py>,
    owner: &Arc<O>,
    data: impl for<'a> FnOnce(&'a O) -> (&'a [T], Vec<usize>),
) -> PyResult<Bound<'py, PyAny>> {
    let (values, shape) = data(owner);
    let array =
        ArrayView::from_shape(IxDyn(&shape), values).map_err(|error| PyRuntimeError::new_err(error.to_string()))?;
    let memory = Bound::new(py, Memory { _owner: owner.clone() })?.into_any();
    // SAFETY: `values` borrows from `*owner`, which `memory`, the base of the array, keeps alive. Nothing changes it:
    // `owner` is shared, and the array is made read-only before anyone else has it.
    let array = unsafe { PyArrayDyn::borrow_from_array(&array, memory) };
    array.readwrite().make_nonwriteable();
    Ok(array.into_any())
}

/// Returns the pixels of a photo: uint8 as stored, or linear float32; shape `[height, width, 3]`.
pub fn photo<'py, O: Send + Sync + 'static>(
    py: Python<'py>,
    owner: &Arc<O>,
    photo: impl for<'a> Fn(&'a O) -> &'a Photo,
) -> PyResult<Bound<'py, PyAny>> {
    match photo(owner) {
        Photo::Linear(_) => view(py, owner, |owner| match photo(owner) {
            Photo::Linear(image) => rgb(image),
            _ => (&[][..], vec![0, 0, 3]),
        }),
        _ => view(py, owner, |owner| match photo(owner) {
            Photo::Srgb8(image) => rgb(image),
            Photo::Encoded8(encoded) => rgb(&encoded.image),
            Photo::Linear(_) => (&[][..], vec![0, 0, 3]),
        }),
    }
}

/// Returns the values of an RGB image and their shape `[height, width, 3]`.
pub fn rgb<T>(image: &Image<[T; 3]>) -> (&[T], Vec<usize>) {
    (image.pixels().as_flattened(), vec![image.height(), image.width(), 3])
}

/// Returns the values of an image of one channel and their shape `[height, width]`.
pub fn grey<T>(image: &Image<T>) -> (&[T], Vec<usize>) {
    (image.pixels(), vec![image.height(), image.width()])
}

/// Moves an RGB image into an array of shape `[height, width, 3]`.
pub fn of_rgb<T: Element>(py: Python<'_>, image: Image<[T; 3]>) -> PyResult<Bound<'_, PyAny>> {
    let shape = [image.height(), image.width(), 3];
    Ok(PyArray::from_vec(py, image.into_pixels().into_flattened()).reshape(shape)?.into_any())
}

/// Moves an image of one channel into an array of shape `[height, width]`.
pub fn of_grey<T: Element>(py: Python<'_>, image: Image<T>) -> PyResult<Bound<'_, PyAny>> {
    let shape = [image.height(), image.width()];
    Ok(PyArray::from_vec(py, image.into_pixels()).reshape(shape)?.into_any())
}

/// Moves rows into an array of shape `[rows, N]`.
pub fn of_rows<T: Element, const N: usize>(py: Python<'_>, rows: Vec<[T; N]>) -> PyResult<Bound<'_, PyAny>> {
    let shape = [rows.len(), N];
    Ok(PyArray::from_vec(py, rows.into_flattened()).reshape(shape)?.into_any())
}

/// Moves values into an array of one axis.
pub fn of_values<T: Element>(py: Python<'_>, values: Vec<T>) -> Bound<'_, PyAny> {
    PyArray::from_vec(py, values).into_any()
}
