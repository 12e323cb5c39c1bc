use std::path::PathBuf;
use std::sync::{Arc, OnceLock};

use lightoctree::depth_models::DepthModel;
use lightoctree::{CheckpointError, DepthSource, Document, EstimateOptions, Estimator, PanoramaPrior, PhotoRequest};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

use crate::choice::{choice, direction};
use crate::errors::Failure;
use crate::inputs::{DepthArray, ImageSource, Lens, file_name, inputs};
use crate::job::{self, Handler, Reporter};
use crate::panorama::Panorama;
use crate::scene::Scene;

/// Estimates the light of a room from one photo.
///
/// The result is that of the command `lightoctree estimate`, to the byte.
///
/// Parameters
/// ----------
/// photo
///     File, PIL image, or array of shape [H, W, 3]: uint8 and uint16 are sRGB, floats are linear Rec. 709 with 1 as
///     the photo's white.
/// depth
///     Depth map of the same view, at any resolution: a file, or an array of floats in metres along the optical axis,
///     0 or NaN where there is no reading. Default: predicted by the built-in network.
/// depth_is
///     "measured" by a sensor, "predicted" by a network, or "inverse": inverse depth of any scale and offset.
/// intrinsics
///     Focal lengths and principal point (fx, fy, cx, cy) in pixels of the photo, a 3 × 3 camera matrix, or a file
///     that states them. Default: from EXIF, else estimated from the photo.
/// hfov_deg
///     Horizontal field of view in degrees, instead of intrinsics.
/// up
///     Direction against gravity in the camera's frame: +X right, +Y up, the camera looks along −Z. Default: estimated.
/// panorama
///     Panorama of the same room, which lights unobserved regions: a file, an array, or a `Panorama` with its position.
/// depth_model
///     ONNX file of a depth network: MoGe-2, Depth Anything V2 or Metric3D v2.
/// weights
///     File with trained weights of the networks. Default: the built-in weights.
/// seed
///     Seed of random numbers.
/// on_event
///     Called with each `Event`. An exception that it raises cancels the estimate. Default: progress bars if tqdm is
///     installed and standard error is a terminal or a notebook.
///
/// Raises
/// ------
/// EstimateError, ImageError
///     If photo, depth or panorama cannot be used; both are a `ValueError`.
/// OSError
///     If a file cannot be read, such as `FileNotFoundError`.
#[pyfunction]
#[pyo3(signature = (
    photo, *, depth = None, depth_is = "measured", intrinsics = None, hfov_deg = None, up = None, panorama = None,
    depth_model = None, weights = None, seed = 0, on_event = None
))]
#[expect(clippy::too_many_arguments, reason = "keyword arguments of Python")]
pub fn estimate(
    py: Python<'_>,
    photo: &Bound<'_, PyAny>,
    depth: Option<&Bound<'_, PyAny>>,
    depth_is: &str,
    intrinsics: Option<&Bound<'_, PyAny>>,
    hfov_deg: Option<f64>,
    up: Option<[f64; 3]>,
    panorama: Option<&Bound<'_, PyAny>>,
    depth_model: Option<&Bound<'_, PyAny>>,
    weights: Option<&Bound<'_, PyAny>>,
    seed: u64,
    on_event: Option<&Bound<'_, PyAny>>,
) -> PyResult<Scene> {
    let kinds =
        [("measured", DepthKind::Measured), ("predicted", DepthKind::Predicted), ("inverse", DepthKind::Inverse)];
    let kind = choice("depth_is", depth_is, &kinds)?;
    if depth.is_none() && kind != DepthKind::Measured {
        return Err(PyValueError::new_err(format!(
            "depth_is={depth_is:?} describes a depth map, but depth is not given"
        )));
    }
    let path = |argument: &str, value: &Bound<'_, PyAny>| -> PyResult<PathBuf> {
        inputs(py)?.call_method1("path", (argument, value))?.extract()
    };
    let depth = match (depth, depth_model) {
        (Some(_), Some(_)) => return Err(PyValueError::new_err("give depth or depth_model, not both")),
        (Some(depth), None) => Depth::Map(kind, DepthArray::new(depth)?),
        (None, Some(model)) => Depth::Model(path("depth_model", model)?),
        (None, None) => Depth::Network,
    };
    let job = Job {
        photo: ImageSource::new("photo", photo)?,
        depth,
        lens: Lens::new(py, intrinsics, hfov_deg)?,
        up: up.map(|up| direction("up", up)).transpose()?,
        panorama: panorama.map(Panorama::given).transpose()?,
        weights: weights.map(|weights| path("weights", weights)).transpose()?,
        seed,
    };
    job::run(py, Handler::new(on_event), |reporter| job.run(reporter)).map(Scene::new)
}

/// Source of a depth map.
#[derive(Clone, Copy, PartialEq)]
enum DepthKind {
    Measured,
    Predicted,
    Inverse,
}

/// Source of the photo's depth.
enum Depth {
    Network,
    Map(DepthKind, DepthArray),
    Model(PathBuf),
}

/// An estimate with all its inputs.
struct Job {
    photo: ImageSource,
    depth: Depth,
    lens: Lens,
    up: Option<lightoctree::geometry::Vec3>,
    panorama: Option<(PanoramaPrior, Option<String>)>,
    weights: Option<PathBuf>,
    seed: u64,
}

impl Job {
    fn run(self, reporter: &mut Reporter) -> Result<Document, Failure> {
        let own;
        let estimator = match &self.weights {
            Some(path) => {
                own = Estimator::read(path)?;
                &own
            }
            None => shipped()?,
        };
        let sources = self.sources();
        let path = match &self.photo {
            ImageSource::File(path) => path.clone(),
            _ => PathBuf::new(),
        };
        let photo = self.photo.photo()?;
        let (camera, distortion) = self.lens.of(&photo, &path)?;
        let depth = match self.depth {
            Depth::Network => DepthSource::Network,
            Depth::Map(DepthKind::Measured, map) => DepthSource::Measured(map.depth_m()?),
            Depth::Map(DepthKind::Predicted, map) => DepthSource::Predicted(map.depth_m()?),
            Depth::Map(DepthKind::Inverse, map) => DepthSource::Inverse(map.inverse()?),
            Depth::Model(path) => {
                let model = DepthModel::read(path, None).map_err(|error| Failure::new("EstimateError", error))?;
                DepthSource::Model(Arc::new(model))
            }
        };
        let request = PhotoRequest { photo, camera, distortion, depth };
        let on_event = &mut |event| reporter.handle(event);
        let resolved = estimator.resolve(request, on_event)?;
        let options = EstimateOptions {
            up: self.up,
            seed: self.seed,
            sources,
            camera_source: resolved.camera_source,
            distorted: resolved.distorted,
            panorama: self.panorama.map(|(prior, _)| prior),
            ..EstimateOptions::default()
        };
        Ok(Document::new(estimator.estimate(resolved.input, &options, on_event)?))
    }

    /// Returns the names of the input files in the order of the command line.
    fn sources(&self) -> Vec<String> {
        let depth = match &self.depth {
            Depth::Network => None,
            Depth::Map(_, map) => map.file_name(),
            Depth::Model(path) => file_name(path),
        };
        let panorama = self.panorama.as_ref().and_then(|(_, file_name)| file_name.clone());
        [self.photo.file_name(), depth, panorama].into_iter().flatten().collect()
    }
}

/// Returns the estimator with the built-in weights, which are read once.
fn shipped() -> Result<&'static Estimator, CheckpointError> {
    static SHIPPED: OnceLock<Estimator> = OnceLock::new();
    if let Some(estimator) = SHIPPED.get() {
        return Ok(estimator);
    }
    let estimator = Estimator::shipped()?;
    Ok(SHIPPED.get_or_init(|| estimator))
}
