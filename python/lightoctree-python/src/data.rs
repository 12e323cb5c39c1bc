use std::path::{Path, PathBuf};
use std::sync::Arc;

use lightoctree::imaging::Image;
use lightoctree::octree::Provenance;
use lo_dataset::{
    CropModel, Dataset, DatasetError, DatasetLayout, GeneratedDataset, Generator, GeneratorConfig, NovelView, Sample,
    Split,
};
use pyo3::exceptions::{PyIndexError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList, PyTuple};

use crate::arrays;
use crate::errors::Failure;
use crate::inputs::inputs;
use crate::job::{self, Handler};
use crate::lights::json;

/// Samples for training and evaluation by index: photos with the light, depth and surfaces of their rooms.
///
/// A sample is a dictionary of NumPy arrays; `lightoctree.data.Sample` describes it. The same index always gives the
/// same sample.
#[pyclass(frozen, sequence, module = "lightoctree.data", name = "Dataset")]
pub struct Samples {
    dataset: Arc<dyn Dataset>,
    /// Function of `lightoctree.data` with its arguments that makes the same data set, for pickles.
    made_by: (&'static str, Py<PyTuple>),
}

/// Returns generated rooms with global illumination, made on demand, about 7 seconds of processor time each.
///
/// `count` is their number. `config` has fields of docs/data.md, such as {"shots": 2}; a room has as many samples as
/// shots.
#[pyfunction]
#[pyo3(signature = (count, *, seed = 0, config = None))]
pub fn rooms(py: Python<'_>, count: u32, seed: u64, config: Option<&Bound<'_, PyAny>>) -> PyResult<Samples> {
    let config: String = match config {
        None => "{}".to_owned(),
        Some(config) => inputs(py)?.call_method1("json_text", (config,))?.extract()?,
    };
    let wrong = |error: String| PyValueError::new_err(format!("config: {error}"));
    let fields: GeneratorConfig = serde_json::from_str(&config).map_err(|error| wrong(error.to_string()))?;
    let generator = Generator::new(seed, fields).map_err(|error| wrong(error.to_string()))?;
    let made_by = ("_rooms", (count, seed, config).into_pyobject(py)?.unbind());
    Ok(Samples { dataset: Arc::new(GeneratedDataset::new(generator, count)), made_by })
}

/// Opens a data set: shards that `lightoctree-lab synth` wrote, or a published one; docs/data.md lists the layouts.
///
/// `seed` is that of the photos that are made from HDR images.
#[pyfunction]
#[pyo3(signature = (path, *, seed = 0))]
pub fn read(py: Python<'_>, path: PathBuf, seed: u64) -> PyResult<Samples> {
    let model = CropModel { seed, ..CropModel::default() };
    let dataset = py.detach(|| open(&path, model)).map_err(|error| Failure::from(error).raise(py))?;
    let made_by = ("_read", (path, seed).into_pyobject(py)?.unbind());
    Ok(Samples { dataset: dataset.into(), made_by })
}

fn open(path: &Path, model: CropModel) -> Result<Box<dyn Dataset>, DatasetError> {
    DatasetLayout::detect(path)?.open(path, model)
}

#[pymethods]
impl Samples {
    fn __len__(&self) -> usize {
        self.dataset.len()
    }

    fn __getitem__<'py>(&self, py: Python<'py>, index: isize) -> PyResult<Bound<'py, PyDict>> {
        let index = self.index(index)?;
        let dataset = self.dataset.clone();
        let sample = job::run(py, Handler::Silent, move |_| Ok(dataset.get(index)?))?;
        dictionary(py, sample)
    }

    fn __iter__<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        let builtins = slf.py().import("builtins")?;
        let indices = builtins.call_method1("range", (slf.len()?,))?;
        builtins.call_method1("map", (slf.getattr("__getitem__")?, indices))
    }

    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<(Bound<'py, PyAny>, Bound<'py, PyTuple>)> {
        let (function, arguments) = &self.made_by;
        Ok((py.import("lightoctree.data")?.getattr(*function)?, arguments.bind(py).clone()))
    }

    /// Returns the part of the data set to which a sample belongs: "train", "validation" or "test".
    fn split(&self, index: isize) -> PyResult<&'static str> {
        Ok(match self.dataset.split(self.index(index)?) {
            Split::Train => "train",
            Split::Validation => "validation",
            Split::Test => "test",
        })
    }

    fn __repr__(&self) -> String {
        format!("<lightoctree.data.Dataset: {} samples>", self.dataset.len())
    }
}

impl Samples {
    /// Returns an index from the start.
    fn index(&self, index: isize) -> PyResult<usize> {
        let len = self.dataset.len();
        let from_start = if index < 0 { len.checked_sub(index.unsigned_abs()) } else { Some(index.unsigned_abs()) };
        let found = from_start.filter(|from_start| *from_start < len);
        found.ok_or_else(|| PyIndexError::new_err(format!("index {index} is out of range for {len} samples")))
    }
}

impl From<DatasetError> for Failure {
    fn from(error: DatasetError) -> Self {
        Self::new("DatasetError", error)
    }
}

/// Moves a sample into a dictionary. What it lacks is absent.
fn dictionary(py: Python<'_>, sample: Sample) -> PyResult<Bound<'_, PyDict>> {
    let camera = sample.camera;
    let fields = PyDict::new(py);
    fields.set_item("id", sample.id)?;
    fields.set_item("scene_id", sample.scene_id)?;
    fields.set_item("photo", arrays::of_rgb(py, sample.photo)?)?;
    fields.set_item("intrinsics", (camera.fx, camera.fy, camera.cx, camera.cy))?;
    if let Some(up) = sample.up {
        fields.set_item("up", (up.x, up.y, up.z))?;
    }
    let images = [("radiance", sample.radiance), ("normal", sample.normal), ("albedo", sample.albedo)];
    set_some(&fields, images, arrays::of_rgb)?;
    set_some(&fields, [("depth_m", sample.depth_m), ("sensor_depth_m", sample.sensor_depth_m)], arrays::of_grey)?;
    if !sample.points.is_empty() {
        let points = &sample.points;
        fields.set_item("points_m", arrays::of_rows(py, points.iter().map(|p| p.position_m.to_array()).collect())?)?;
        fields.set_item("points_radiance", arrays::of_rows(py, points.iter().map(|p| p.radiance).collect())?)?;
        let observed = points.iter().map(|point| point.provenance == Provenance::Observed).collect();
        fields.set_item("points_observed", arrays::of_values(py, observed))?;
    }
    let views: Vec<Bound<'_, PyDict>> =
        sample.views.into_iter().map(|view| of_view(py, view)).collect::<PyResult<_>>()?;
    fields.set_item("views", PyList::new(py, views)?)?;
    fields.set_item("metadata", json(py, &sample.metadata)?)?;
    Ok(fields)
}

fn of_view(py: Python<'_>, view: NovelView) -> PyResult<Bound<'_, PyDict>> {
    let fields = PyDict::new(py);
    let [x, y, z, w] = view.rotation.to_array();
    fields.set_item("position_m", (view.position_m.x, view.position_m.y, view.position_m.z))?;
    fields.set_item("rotation_xyzw", (x, y, z, w))?;
    fields.set_item("radiance", arrays::of_rgb(py, view.radiance)?)?;
    set_some(&fields, [("depth_m", view.depth_m)], arrays::of_grey)?;
    Ok(fields)
}

/// Sets the images that there are.
fn set_some<'py, T, const N: usize>(
    fields: &Bound<'py, PyDict>,
    images: [(&str, Option<Image<T>>); N],
    convert: impl Fn(Python<'py>, Image<T>) -> PyResult<Bound<'py, PyAny>>,
) -> PyResult<()> {
    for (name, image) in images {
        if let Some(image) = image {
            fields.set_item(name, convert(fields.py(), image)?)?;
        }
    }
    Ok(())
}
