//! Depth of a photo by a third-party depth model.

use lo_depth_models::affine::{Fit, fit_inverse, fit_log, metres_of_inverse, metres_of_log};
use lo_depth_models::{DepthModel, Geometry};
use lo_events::{OnEvent, stage, warn};
use lo_geometry::Camera;
use lo_imaging::{DepthMap, Image, Photo, resize_depth};
use lo_scene::{CameraSource, Frame, working_photo};

use crate::framed::FramedPhoto;
use crate::{EstimateError, EstimateWarning, Estimator, PredictedDepth, stages};

/// Largest ratio between the aspects of depth and photo at which depth is not resampled to the photo's aspect.
const SAME_ASPECT: f64 = 1.005;

impl Estimator {
    /// Predicts a photo's depth with a third-party depth model (feature `depth-models`).
    ///
    /// `camera` is in pixels of the photo. If it is `None`, the model predicts the field of view; if it cannot, the
    /// lens is determined as in [`Estimator::camera_of`], without EXIF. The second value is the source of the lens,
    /// `None` where `camera` was given.
    ///
    /// Relative depth is converted to metres by a robust fit to this estimator's own depth network.
    /// [`EstimateWarning::FittedDepth`] reports how well the two agree. The model sees the picture between black bars.
    ///
    /// # Errors
    /// - The errors of [`DepthModel::predict`].
    /// - [`EstimateError::NoNetworks`] if depth is relative and the estimator has no networks.
    /// - [`EstimateError::RelativeDepth`] if relative depth does not correlate with the own network's.
    /// - [`EstimateError::Frame`] if photo and depth do not form a [`Frame`].
    /// - [`EstimateError::Cancelled`] if `on_event` breaks off.
    pub fn predict_depth(
        &self,
        photo: Photo,
        camera: Option<Camera>,
        model: &DepthModel,
        on_event: OnEvent<'_>,
    ) -> Result<(PredictedDepth, Option<CameraSource>), EstimateError> {
        let Some(framed) = FramedPhoto::of(&photo, camera.as_ref()) else {
            return self.predict_depth_of_picture(photo, camera, model, on_event);
        };
        let camera = camera.map(|camera| framed.camera_of_picture(&camera));
        let (predicted, source) = self.predict_depth_of_picture(framed.picture(), camera, model, on_event)?;
        Ok((framed.predicted_depth(predicted), source))
    }

    /// Predicts the depth of a photo without black bars.
    fn predict_depth_of_picture(
        &self,
        photo: Photo,
        camera: Option<Camera>,
        model: &DepthModel,
        on_event: OnEvent<'_>,
    ) -> Result<(PredictedDepth, Option<CameraSource>), EstimateError> {
        let (width, height) = (photo.width() as u32, photo.height() as u32);
        let own_lens = || self.camera_of_picture(&photo).map_err(lo_scene::FrameError::from);
        let (known, mut source) = match camera {
            Some(camera) => (Some(camera), None),
            None if model.predicts_field_of_view() => (None, Some(CameraSource::DepthModel)),
            None => own_lens().map(|(camera, source)| (Some(camera), Some(source)))?,
        };
        let predicted = model.predict(&photo.srgb8(), known.as_ref(), on_event)?;
        let angle = predicted.field_of_view.map(|angles| angles.horizontal_deg);
        let camera = match (known, angle) {
            (Some(camera), _) => camera,
            (None, Some(angle)) => Camera::from_hfov_deg(angle, width, height).map_err(lo_scene::FrameError::from)?,
            (None, None) => {
                let (camera, own) = own_lens()?;
                source = Some(own);
                camera
            }
        };
        let depth_m = match predicted.geometry {
            Geometry::Metric(depth_m) => depth_m,
            Geometry::AffineInverse(inverse) => self.metres_from_inverse(&inverse, &photo, &camera, on_event)?,
            Geometry::Log(log) => {
                let own_m = self.own_depth(&photo, &camera, on_event)?;
                let fit = fit_log(&log, &own_m)?;
                warn(on_event, fit_warning(&fit))?;
                metres_of_log(&log, &fit)
            }
        };
        let depth_m = at_photo_aspect(depth_m, width as usize, height as usize);
        let frame = Frame::new(photo, depth_m, camera, 1.0)?;
        Ok((PredictedDepth { frame, normals: predicted.normals, model: Some(model.name()) }, source))
    }

    /// Converts inverse depth of any scale and offset to metres, by a fit to the own network's depth.
    pub(crate) fn depth_from_inverse(
        &self,
        photo: Photo,
        camera: Camera,
        inverse: &Image<f32>,
        on_event: OnEvent<'_>,
    ) -> Result<PredictedDepth, EstimateError> {
        let Some(framed) = FramedPhoto::of(&photo, Some(&camera)) else {
            let depth_m = self.metres_from_inverse(inverse, &photo, &camera, on_event)?;
            return Ok(Frame::new(photo, depth_m, camera, 1.0)?.into());
        };
        let (picture, camera) = (framed.picture(), framed.camera_of_picture(&camera));
        let depth_m = self.metres_from_inverse(&framed.cropped(inverse), &picture, &camera, on_event)?;
        Ok(framed.predicted_depth(Frame::new(picture, depth_m, camera, 1.0)?.into()))
    }

    fn metres_from_inverse(
        &self,
        inverse: &Image<f32>,
        photo: &Photo,
        camera: &Camera,
        on_event: OnEvent<'_>,
    ) -> Result<DepthMap, EstimateError> {
        let own_m = self.own_depth(photo, camera, on_event)?;
        let fit = fit_inverse(inverse, &own_m)?;
        warn(on_event, fit_warning(&fit))?;
        Ok(metres_of_inverse(inverse, &fit))
    }

    /// Predicts depth in metres by the estimator's own network.
    fn own_depth(&self, photo: &Photo, camera: &Camera, on_event: OnEvent<'_>) -> Result<DepthMap, EstimateError> {
        let networks = self.networks().ok_or(EstimateError::NoNetworks("relative or inverse depth"))?;
        let small = stage(on_event, stages::WORKING_RESOLUTION, || working_photo(photo))?;
        let depth_m =
            stage(on_event, stages::DEPTH_AND_GLOBAL_LIGHT, || networks.predict(&small.srgb8(), camera).depth_m)?;
        if depth_m.pixels().iter().all(|z| z.is_finite()) { Ok(depth_m) } else { Err(EstimateError::NonFiniteDepth) }
    }
}

fn fit_warning(fit: &Fit) -> EstimateWarning {
    EstimateWarning::FittedDepth { scale: fit.a, offset: fit.b, agree: fit.agree, median_error: fit.error }
}

/// Resamples depth to the photo's aspect if the photo was stretched for the model.
fn at_photo_aspect(depth_m: DepthMap, width: usize, height: usize) -> DepthMap {
    let (aspect, wanted) = (depth_m.width() as f64 / depth_m.height() as f64, width as f64 / height as f64);
    if (aspect / wanted).max(wanted / aspect) < SAME_ASPECT {
        return depth_m;
    }
    let scale = depth_m.width().max(depth_m.height()) as f64 / width.max(height) as f64;
    let side = |pixels: usize| ((pixels as f64 * scale).round() as usize).max(1);
    resize_depth(&depth_m, side(width), side(height))
}
