#[cfg(feature = "depth-models")]
use lo_depth_models::DepthModel;
use lo_events::OnEvent;
use lo_geometry::Camera;
#[cfg(feature = "depth-models")]
use lo_imaging::Image;
use lo_imaging::{DepthMap, PhotoFile};
use lo_scene::{CameraSource, Frame, FrameError};

use crate::{EstimateError, Estimator, Input};

/// A photo with the user's information on its camera and depth, as front ends receive it.
///
/// [`Estimator::resolve`] turns it into an [`Input`].
#[derive(Debug)]
pub struct PhotoRequest {
    /// The photo file with its EXIF data.
    pub photo: PhotoFile,
    /// The camera in pixels of the photo, if the user gives it.
    ///
    /// Otherwise it comes from EXIF, the depth model, the networks or [`DEFAULT_HFOV_DEG`](crate::DEFAULT_HFOV_DEG).
    pub camera: Option<Camera>,
    /// Source of the depth.
    pub depth: DepthSource,
}

/// The source of a photo's depth.
#[derive(Debug)]
#[non_exhaustive]
pub enum DepthSource {
    /// The estimator's own depth network.
    Network,
    /// Depth of a sensor, in metres along the optical axis, at any resolution.
    Measured(DepthMap),
    /// Depth predicted by another program's network, in metres along the optical axis, at any resolution.
    Predicted(DepthMap),
    /// Inverse depth or disparity predicted by another program, in any unit and with any offset, at any resolution
    /// (feature `depth-models`). It is fitted to the estimator's own depth network.
    #[cfg(feature = "depth-models")]
    Inverse(Image<f32>),
    /// A third-party depth model in an ONNX file (feature `depth-models`).
    #[cfg(feature = "depth-models")]
    Model(Box<DepthModel>),
}

/// A request with its camera and depth determined.
#[derive(Debug)]
pub struct ResolvedPhoto {
    /// The input of [`Estimator::estimate`].
    pub input: Input,
    /// The camera, in pixels of the photo.
    pub camera: Camera,
    /// Source of the camera, `None` if the user gave it.
    ///
    /// It belongs into [`EstimateOptions::camera_source`](crate::EstimateOptions::camera_source).
    pub camera_source: Option<CameraSource>,
}

impl Estimator {
    /// Determines the camera of a photo, runs its depth model, if it has one, and fits inverse depth.
    ///
    /// # Errors
    /// - [`EstimateError::Frame`] if the photo has no pixels, or photo and depth do not form a [`Frame`].
    /// - With [`DepthSource::Model`], the errors of `Estimator::predict_depth`; with [`DepthSource::Inverse`], those of
    ///   its relative depth.
    /// - [`EstimateError::Cancelled`] if `on_event` breaks off.
    #[cfg_attr(not(feature = "depth-models"), expect(unused_variables))]
    pub fn resolve(&self, request: PhotoRequest, on_event: OnEvent<'_>) -> Result<ResolvedPhoto, EstimateError> {
        let PhotoRequest { photo, camera, depth } = request;
        #[cfg(feature = "depth-models")]
        if let DepthSource::Model(model) = depth {
            let known = match camera {
                Some(camera) => Some((camera, None)),
                None if photo.focal_px().is_some() => {
                    let (camera, source) = self.camera_of(&photo).map_err(FrameError::from)?;
                    Some((camera, Some(source)))
                }
                None => None,
            };
            let known_camera = known.map(|(camera, _)| camera);
            let (predicted, predicted_source) = self.predict_depth(photo.photo, known_camera, &model, on_event)?;
            let camera_source = known.map_or(predicted_source, |(_, source)| source);
            let camera = predicted.frame.camera;
            return Ok(ResolvedPhoto { input: Input::PredictedDepth(predicted), camera, camera_source });
        }
        let (camera, camera_source) = match camera {
            Some(camera) => (camera, None),
            None => {
                let (camera, source) = self.camera_of(&photo).map_err(FrameError::from)?;
                (camera, Some(source))
            }
        };
        let photo = photo.photo;
        let input = match depth {
            DepthSource::Measured(depth_m) => Input::MeasuredDepth(Frame::new(photo, depth_m, camera, 1.0)?),
            DepthSource::Predicted(depth_m) => Input::PredictedDepth(Frame::new(photo, depth_m, camera, 1.0)?.into()),
            #[cfg(feature = "depth-models")]
            DepthSource::Inverse(inverse) => {
                Input::PredictedDepth(self.depth_from_inverse(photo, camera, &inverse, on_event)?)
            }
            _ => Input::Photo { photo, camera },
        };
        Ok(ResolvedPhoto { input, camera, camera_source })
    }
}
