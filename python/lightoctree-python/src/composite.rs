use std::path::PathBuf;
use std::sync::Arc;

use lightoctree::imaging::{self, ExrOptions, RadianceImage};
use lightoctree::insert::{self, Cryptomatte, Passes};
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyDict};

use crate::arrays::{self, grey, rgb};
use crate::errors::Failure;
use crate::preview::png;
use crate::signature;

/// A layer that not all composites have.
type OptionalLayer = fn(&insert::Composite) -> Option<&RadianceImage>;

/// A photo with inserted objects, and its layers.
#[pyclass(frozen, module = "lightoctree")]
pub struct Composite(Arc<insert::Composite>);

impl Composite {
    /// Wraps a composite.
    pub fn new(composite: insert::Composite) -> Self {
        Self(Arc::new(composite))
    }
}

impl Composite {
    fn mattes<'py>(&self, py: Python<'py>, of: fn(&Passes) -> &Cryptomatte) -> PyResult<Bound<'py, PyDict>> {
        let mattes = PyDict::new(py);
        let Some(passes) = &self.0.passes else { return Ok(mattes) };
        for (i, (name, _)) in of(passes).coverage.iter().enumerate() {
            let values = arrays::view(py, &self.0, |composite| match &composite.passes {
                Some(passes) => grey(&of(passes).coverage[i].1),
                None => (&[][..], vec![0, 0]),
            })?;
            mattes.set_item(name, values)?;
        }
        Ok(mattes)
    }
}

#[pymethods]
impl Composite {
    /// The image, read-only, [H, W, 3]: uint8 like an 8-bit photo, else linear float32.
    ///
    /// Pixels that the objects do not change are the photo's.
    #[getter]
    fn image<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        arrays::photo(py, &self.0, |composite| &composite.image)
    }

    /// The layers by name, read-only float32 arrays: `object` (premultiplied radiance) and `shadow_ratio` [H, W, 3],
    /// `alpha` and `occlusion` [H, W]; with a glossy floor `reflection`, and in a photo with noise `grain` [H, W, 3].
    /// With `passes=True` also `diffuse`, `specular`, `transmission`, `emission`, `edge`, `albedo`, `normal`,
    /// `position` [H, W, 3] and `depth` [H, W] of docs/layers.md.
    ///
    /// The image is (photo · shadow_ratio + reflection) · (1 − alpha) + object + grain, in linear light.
    #[getter]
    fn layers<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let layers = PyDict::new(py);
        layers.set_item("object", arrays::view(py, &self.0, |composite| rgb(&composite.object))?)?;
        layers.set_item("alpha", arrays::view(py, &self.0, |composite| grey(&composite.alpha))?)?;
        layers.set_item("shadow_ratio", arrays::view(py, &self.0, |composite| rgb(&composite.shadow_ratio))?)?;
        layers.set_item("occlusion", arrays::view(py, &self.0, |composite| grey(&composite.occlusion))?)?;
        let optional: [(&str, OptionalLayer); 10] = [
            ("reflection", |composite| composite.reflection.as_ref()),
            ("grain", |composite| composite.grain.as_ref()),
            ("diffuse", |composite| Some(&composite.passes.as_ref()?.diffuse)),
            ("specular", |composite| Some(&composite.passes.as_ref()?.specular)),
            ("transmission", |composite| Some(&composite.passes.as_ref()?.transmission)),
            ("emission", |composite| Some(&composite.passes.as_ref()?.emission)),
            ("edge", |composite| Some(&composite.passes.as_ref()?.edge)),
            ("albedo", |composite| Some(&composite.passes.as_ref()?.albedo)),
            ("normal", |composite| Some(&composite.passes.as_ref()?.normal)),
            ("position", |composite| Some(&composite.passes.as_ref()?.position_m)),
        ];
        if self.0.passes.is_some() {
            let depth = arrays::view(py, &self.0, |composite| match &composite.passes {
                Some(passes) => grey(&passes.depth_m),
                None => (&[][..], vec![0, 0]),
            })?;
            layers.set_item("depth", depth)?;
        }
        for (name, layer) in optional {
            if layer(&self.0).is_some() {
                let values = arrays::view(py, &self.0, |composite| match layer(composite) {
                    Some(image) => rgb(image),
                    None => (&[][..], vec![0, 0, 3]),
                })?;
                layers.set_item(name, values)?;
            }
        }
        Ok(layers)
    }

    /// The share of each pixel, [H, W], that shows each object, by its name; empty without `passes=True`.
    #[getter]
    fn object_mattes<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        self.mattes(py, |passes| &passes.objects)
    }

    /// The share of each pixel, [H, W], that shows each material, by its name; empty without `passes=True`.
    #[getter]
    fn material_mattes<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        self.mattes(py, |passes| &passes.materials)
    }

    /// Writes the image to a .png, .jpg, .exr, .hdr or .pfm file, with the photo's colour profile and metadata.
    fn save(&self, py: Python<'_>, path: PathBuf) -> PyResult<()> {
        let written = py.detach(|| imaging::write_photo(path, &self.0.image, &signature("insert")));
        written.map_err(|error| Failure::from(error).raise(py))
    }

    /// Writes the layers to an .exr file.
    fn save_layers(&self, py: Python<'_>, path: PathBuf) -> PyResult<()> {
        let write = || {
            let size = (self.0.alpha.width(), self.0.alpha.height());
            let (generator, metadata) = (signature("insert"), self.0.metadata());
            let options = ExrOptions { generator, metadata, ..ExrOptions::default() };
            lo_imaging::write_exr(path, size, &self.0.channels(), &options)
        };
        py.detach(write).map_err(|error| Failure::from(error).raise(py))
    }

    fn _repr_png_<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyBytes>> {
        png(py, &self.0.image)
    }

    fn __repr__(&self) -> String {
        format!("<lightoctree.Composite: {} × {} pixels>", self.0.image.width(), self.0.image.height())
    }
}
