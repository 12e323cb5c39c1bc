//! Depth of a photo by a depth network of others.

use lo_depth_models::affine::{Fit, fit_inverse, fit_log, metres_of_inverse, metres_of_log};
use lo_depth_models::{DepthModel, Geometry};
use lo_events::{OnEvent, Stage, Warning, stage, warn};
use lo_geometry::Camera;
use lo_imaging::{DepthMap, Photo, resize_depth};
use lo_scene::{Frame, working_photo};

use crate::view::srgb8;
use lo_scene::CameraSource;

use crate::{EstimateError, Estimator, PredictedDepth};

/// Depth of another aspect than the photo's, by more than this factor, is brought to the photo's.
const SAME_ASPECT: f64 = 1.005;

impl Estimator {
    /// Depth of a photo by a depth model. `camera`, in pixels of the photo, where the lens is known; where it is not, the model tells the field of view if it
    /// can, and if not [the lens is guessed](Estimator::camera_of): the second value says which.
    ///
    /// Relative depth is brought to the metres of this estimator's own depth network by a robust fit; a [`Warning::FittedDepth`] says how well they agree.
    ///
    /// # Errors
    /// All of [`DepthModel::predict`]; relative depth without networks, or that has nothing to do with the own network's; depth that makes no frame;
    /// [`Cancelled`](lo_events::Cancelled) where `on_event` breaks off, between two steps.
    pub fn predict_depth(
        &self,
        photo: Photo,
        camera: Option<Camera>,
        model: &DepthModel,
        on_event: OnEvent<'_>,
    ) -> Result<(PredictedDepth, Option<CameraSource>), EstimateError> {
        let (width, height) = (photo.width() as u32, photo.height() as u32);
        let own_lens = || self.lens_of(&photo).map_err(lo_scene::FrameError::from);
        let (known, mut source) = match camera {
            Some(camera) => (Some(camera), None),
            None if model.predicts_field_of_view() => (None, Some(CameraSource::DepthModel)),
            None => own_lens().map(|(camera, source)| (Some(camera), Some(source)))?,
        };
        let told = model.predict(&srgb8(&photo), known.as_ref(), on_event)?;
        let angle = told.field_of_view.map(|angles| angles.horizontal_deg);
        let camera = match (known, angle) {
            (Some(camera), _) => camera,
            (None, Some(angle)) => Camera::from_hfov_deg(angle, width, height).map_err(lo_scene::FrameError::from)?,
            (None, None) => {
                let (camera, own) = own_lens()?;
                source = Some(own);
                camera
            }
        };
        let depth_m = match told.geometry {
            Geometry::Metric(depth_m) => depth_m,
            Geometry::AffineInverse(inverse) => {
                let own_m = self.own_depth(&photo, &camera, on_event)?;
                let fit = fit_inverse(&inverse, &own_m)?;
                warn(on_event, fitted(&fit))?;
                metres_of_inverse(&inverse, &fit)
            }
            Geometry::Log(log) => {
                let own_m = self.own_depth(&photo, &camera, on_event)?;
                let fit = fit_log(&log, &own_m)?;
                warn(on_event, fitted(&fit))?;
                metres_of_log(&log, &fit)
            }
        };
        let depth_m = of_aspect(depth_m, width as usize, height as usize);
        let frame = Frame::new(photo, depth_m, camera, 1.0)?;
        Ok((PredictedDepth { frame, normals: told.normals, model: Some(model.name()) }, source))
    }

    /// Metres by the own network.
    fn own_depth(&self, photo: &Photo, camera: &Camera, on_event: OnEvent<'_>) -> Result<DepthMap, EstimateError> {
        let networks = self.networks().ok_or(EstimateError::NoNetworks("a depth model of relative depth"))?;
        let small = stage(on_event, Stage::WorkingResolution, || working_photo(photo))?;
        let depth_m = stage(on_event, Stage::DepthAndGlobalLight, || networks.predict(&srgb8(&small), camera).depth_m)?;
        if depth_m.pixels().iter().all(|z| z.is_finite()) { Ok(depth_m) } else { Err(EstimateError::PredictedDepth) }
    }
}

fn fitted(fit: &Fit) -> Warning {
    Warning::FittedDepth { scale: fit.a, offset: fit.b, agree: fit.agree, median_error: fit.error }
}

/// Depth of a photo that was stretched for a model, at the photo's own aspect.
fn of_aspect(depth_m: DepthMap, width: usize, height: usize) -> DepthMap {
    let (aspect, wanted) = (depth_m.width() as f64 / depth_m.height() as f64, width as f64 / height as f64);
    if (aspect / wanted).max(wanted / aspect) < SAME_ASPECT {
        return depth_m;
    }
    let scale = depth_m.width().max(depth_m.height()) as f64 / width.max(height) as f64;
    let side = |pixels: usize| ((pixels as f64 * scale).round() as usize).max(1);
    resize_depth(&depth_m, side(width), side(height))
}
