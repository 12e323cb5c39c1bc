#[cfg(feature = "depth-models")]
use lo_depth_models::DepthModel;
use lo_events::OnEvent;
use lo_geometry::Camera;
use lo_imaging::{DepthMap, PhotoFile};
use lo_scene::{CameraSource, Frame, FrameError};

use crate::{EstimateError, Estimator, Input};

/// A photo with what else is known of its view: what every front end starts an estimate from.
#[derive(Debug)]
pub struct PhotoRequest {
    /// The photo as it was read.
    pub photo: PhotoFile,
    /// The camera, where the user states it. Otherwise EXIF, a depth model, the networks or a default tell it.
    pub camera: Option<Camera>,
    /// Where depth comes from.
    pub depth: DepthSource,
}

/// Where a photo's depth comes from.
#[derive(Debug)]
pub enum DepthSource {
    /// The program's own depth network.
    Network,
    /// A sensor, in metres along the optical axis, of any resolution.
    Measured(DepthMap),
    /// Another program's network, in metres along the optical axis, of any resolution.
    Predicted(DepthMap),
    /// A third-party depth model.
    #[cfg(feature = "depth-models")]
    Model(Box<DepthModel>),
}

/// A request whose camera and depth are settled.
#[derive(Debug)]
pub struct ResolvedPhoto {
    /// The input of [`Estimator::estimate`].
    pub input: Input,
    /// The camera, in pixels of the photo.
    pub camera: Camera,
    /// Where the camera comes from, unless the user stated it:
    /// [`EstimateOptions::camera_source`](crate::EstimateOptions::camera_source).
    pub camera_source: Option<CameraSource>,
}

impl Estimator {
    /// Settles the camera of a photo and runs its depth model, if it has one.
    ///
    /// # Errors
    /// A photo without pixels, depth of another aspect, models whose output cannot be used; `Cancelled` where
    /// `on_event` breaks off.
    #[cfg_attr(not(feature = "depth-models"), expect(unused_variables, clippy::needless_pass_by_ref_mut))]
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
            let (predicted, told) = self.predict_depth(photo.photo, known_camera, &model, on_event)?;
            let camera_source = known.map_or(told, |(_, source)| source);
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
            _ => Input::Photo { photo, camera },
        };
        Ok(ResolvedPhoto { input, camera, camera_source })
    }
}
