use lightoctree::PanoramaPrior;
use lightoctree::geometry::Orientation;
use lightoctree::imaging::{self, Photo};
use pyo3::prelude::*;

use crate::choice::{orientation, point};
use crate::errors::Failure;
use crate::inputs::ImageSource;
use crate::signature;

/// Name of a panorama that comes from an array, in the scene and in messages.
const UNNAMED: &str = "panorama";

/// A panorama of the photo's room, which lights regions that the photo does not show.
#[pyclass(frozen, module = "lightoctree")]
pub struct Panorama {
    prior: PanoramaPrior,
    file_name: Option<String>,
}

#[pymethods]
impl Panorama {
    /// Reads a panorama from a file, a PIL image or an array of shape [H, 2 H, 3].
    #[new]
    #[pyo3(
        signature = (image, *, at = [0.0; 3], orientation = "lightoctree", yaw_deg = None, exposure_ev = None),
        text_signature = "(image, *, at=(0, 0, 0), orientation='lightoctree', yaw_deg=None, exposure_ev=None)"
    )]
    fn new(
        py: Python<'_>,
        image: &Bound<'_, PyAny>,
        at: [f64; 3],
        orientation: &str,
        yaw_deg: Option<f64>,
        exposure_ev: Option<f64>,
    ) -> PyResult<Self> {
        let (at_m, orientation) = (point("at", at)?, self::orientation(orientation)?);
        let source = ImageSource::new("panorama", image)?;
        let file_name = source.file_name();
        let prior = py.detach(|| read(source, orientation)).map_err(|failure| failure.raise(py))?;
        let mut prior = prior.at(at_m);
        prior.yaw_rad = yaw_deg.map(|yaw| (yaw as f32).to_radians());
        prior.exposure = exposure_ev.map(|ev| (ev as f32).exp2());
        prior.check().map_err(|error| Failure::from(error).raise(py))?;
        Ok(Self { prior, file_name })
    }

    fn __repr__(&self) -> String {
        let (radiance, at) = (self.prior.radiance(), self.prior.position_m);
        format!(
            "<lightoctree.Panorama {:?}: {} × {} pixels at ({}, {}, {})>",
            self.prior.file,
            radiance.width(),
            radiance.height(),
            at.x,
            at.y,
            at.z
        )
    }
}

impl Panorama {
    /// Returns the panorama that a user gives, and the name of its file.
    pub fn given(value: &Bound<'_, PyAny>) -> PyResult<(PanoramaPrior, Option<String>)> {
        let given = match value.cast::<Self>() {
            Ok(given) => given.clone(),
            Err(_) => value.py().get_type::<Self>().call1((value,))?.cast_into()?,
        };
        Ok((given.get().prior.clone(), given.get().file_name.clone()))
    }
}

fn read(source: ImageSource, orientation: Orientation) -> Result<PanoramaPrior, Failure> {
    let prior = match source {
        ImageSource::File(path) => PanoramaPrior::read(path, orientation)?,
        ImageSource::Encoded(bytes) => PanoramaPrior::from_bytes(&bytes, orientation, UNNAMED)?,
        ImageSource::Pixels(Photo::Linear(radiance)) => PanoramaPrior::new(radiance, orientation, UNNAMED)?,
        // Files of 8 bits are clipped, and so are such arrays.
        ImageSource::Pixels(photo) => {
            let png = imaging::encode_photo("panorama.png", &photo, &signature("panorama"))?;
            PanoramaPrior::from_bytes(&png, orientation, UNNAMED)?
        }
    };
    Ok(prior)
}
