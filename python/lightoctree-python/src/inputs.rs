//! Photos, depth and lenses as Python passes them. `lightoctree._inputs` has converted them to paths, bytes and arrays
//! in C order, and checked shapes and types.

use std::path::{Path, PathBuf};

use lightoctree::geometry::{Camera, Distortion};
use lightoctree::imaging::{self, DepthMap, Image, ImageError, Photo, PhotoFile};
use lightoctree::scene::poses::PhotoLens;
use numpy::{Element, PyReadonlyArray3, PyUntypedArrayMethods};
use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyString};

use crate::errors::Failure;

/// A photo or panorama.
pub enum ImageSource {
    /// A file.
    File(PathBuf),
    /// The bytes of a file.
    Encoded(Vec<u8>),
    /// Pixels of an array.
    Pixels(Photo),
}

impl ImageSource {
    /// Converts what a user gives as this argument.
    pub fn new(argument: &str, value: &Bound<'_, PyAny>) -> PyResult<Self> {
        let value = inputs(value.py())?.call_method1("image", (argument, value))?;
        if value.is_instance_of::<PyString>() {
            return Ok(Self::File(value.extract()?));
        }
        if let Ok(bytes) = value.cast::<PyBytes>() {
            return Ok(Self::Encoded(bytes.as_bytes().to_vec()));
        }
        if let Ok(pixels) = value.extract::<PyReadonlyArray3<'_, u8>>() {
            return Ok(Self::Pixels(Photo::Srgb8(image(&pixels)?)));
        }
        if let Ok(pixels) = value.extract::<PyReadonlyArray3<'_, u16>>() {
            let linear = |rgb: &[u16; 3]| rgb.map(|v| lo_imaging::linear_from_srgb(f32::from(v) / 65535.0));
            return Ok(Self::Pixels(Photo::Linear(image(&pixels)?.map(linear))));
        }
        let pixels: PyReadonlyArray3<'_, f32> = value.extract()?;
        Ok(Self::Pixels(Photo::Linear(image(&pixels)?)))
    }

    /// Returns the name of its file, which the scene stores.
    pub fn file_name(&self) -> Option<String> {
        match self {
            Self::File(path) => file_name(path),
            _ => None,
        }
    }

    /// Reads it as a photo.
    pub fn photo(self) -> Result<PhotoFile, ImageError> {
        match self {
            Self::File(path) => imaging::read_photo(path),
            Self::Encoded(bytes) => imaging::photo_from_bytes(&bytes, "photo"),
            Self::Pixels(photo) => Ok(PhotoFile::new(photo)),
        }
    }
}

/// Returns a file's name without its folder.
pub fn file_name(path: &Path) -> Option<String> {
    path.file_name().map(|name| name.to_string_lossy().into_owned())
}

/// Copies an array in C order of shape `[height, width, 3]`.
fn image<T: Element + Copy>(array: &PyReadonlyArray3<'_, T>) -> PyResult<Image<[T; 3]>> {
    let wrong = || PyTypeError::new_err("lightoctree._inputs returned an array that is not an image in C order");
    let (pixels, rest) = array.as_slice().map_err(|_| wrong())?.as_chunks::<3>();
    let &[height, width, 3] = array.shape() else { return Err(wrong()) };
    if rest.is_empty() { Ok(Image::new(width, height, pixels.to_vec())) } else { Err(wrong()) }
}

/// A depth map, or inverse depth.
pub enum DepthArray {
    /// A file.
    File(PathBuf),
    /// An array as an NPY file.
    Npy(Vec<u8>),
}

impl DepthArray {
    /// Converts what a user gives.
    pub fn new(value: &Bound<'_, PyAny>) -> PyResult<Self> {
        let value = inputs(value.py())?.call_method1("depth", (value,))?;
        match value.cast::<PyBytes>() {
            Ok(bytes) => Ok(Self::Npy(bytes.as_bytes().to_vec())),
            Err(_) => Ok(Self::File(value.extract()?)),
        }
    }

    /// Returns the name of its file, which the scene stores.
    pub fn file_name(&self) -> Option<String> {
        match self {
            Self::File(path) => file_name(path),
            Self::Npy(_) => None,
        }
    }

    /// Reads depth in metres.
    pub fn depth_m(&self) -> Result<DepthMap, Failure> {
        match self {
            Self::File(path) => Ok(imaging::read_depth(path, None)?),
            Self::Npy(bytes) => imaging::depth_from_bytes(bytes, "depth", None).map_err(of_array),
        }
    }

    /// Reads inverse depth.
    pub fn inverse(&self) -> Result<Image<f32>, Failure> {
        match self {
            Self::File(path) => Ok(imaging::read_inverse_depth(path)?),
            Self::Npy(bytes) => imaging::inverse_depth_from_bytes(bytes, "depth").map_err(of_array),
        }
    }
}

/// Returns the error of an array without the words about its file.
fn of_array(error: ImageError) -> Failure {
    match error {
        ImageError::Invalid { reason, .. } => Failure::argument("depth", reason),
        error => error.into(),
    }
}

/// The lens that a user gives.
pub enum Lens {
    /// None; it is found.
    Found,
    /// Focal lengths and principal point in pixels.
    Numbers([f64; 4]),
    /// A file that states them.
    File(PathBuf),
    /// Horizontal field of view in degrees.
    HfovDeg(f64),
}

impl Lens {
    /// Converts what a user gives.
    pub fn new(py: Python<'_>, intrinsics: Option<&Bound<'_, PyAny>>, hfov_deg: Option<f64>) -> PyResult<Self> {
        match (intrinsics, hfov_deg) {
            (Some(_), Some(_)) => Err(PyValueError::new_err("give intrinsics or hfov_deg, not both")),
            (Some(given), None) => {
                let given = inputs(py)?.call_method1("intrinsics", (given,))?;
                if given.is_instance_of::<PyString>() {
                    return Ok(Self::File(given.extract()?));
                }
                given.extract().map(Self::Numbers)
            }
            (None, Some(hfov_deg)) => Ok(Self::HfovDeg(hfov_deg)),
            (None, None) => Ok(Self::Found),
        }
    }

    /// Returns the camera of a photo, if given, and the distortion that the lens's file states.
    pub fn of(&self, photo: &PhotoFile, path: &Path) -> Result<(Option<Camera>, Option<Distortion>), Failure> {
        let (width, height) = (photo.photo.width() as u32, photo.photo.height() as u32);
        let camera = match self {
            Self::Found => return Ok((None, None)),
            Self::Numbers([fx, fy, cx, cy]) => {
                let camera = Camera::new(*fx, *fy, *cx, *cy, width, height);
                camera.map_err(|error| Failure::argument("intrinsics", error))?
            }
            Self::HfovDeg(hfov_deg) => {
                let camera = Camera::from_hfov_deg(*hfov_deg, width, height);
                camera.map_err(|error| Failure::argument("hfov_deg", error))?
            }
            Self::File(file) => {
                let wrong = |error| Failure::new("EstimateError", error);
                let lens = PhotoLens::read(file, path).map_err(wrong)?;
                let camera = lens.camera(width, height).map_err(wrong)?;
                return Ok((Some(camera), lens.distortion.filter(|distortion| !distortion.is_identity())));
            }
        };
        Ok((Some(camera), None))
    }
}

/// Returns the module that converts Python objects.
pub fn inputs(py: Python<'_>) -> PyResult<Bound<'_, PyModule>> {
    py.import("lightoctree._inputs")
}
