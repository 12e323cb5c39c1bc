use std::sync::Arc;

#[cfg(feature = "depth-models")]
use lo_depth_models::DepthModel;
use lo_events::{OnEvent, warn};
use lo_geometry::{Camera, Distortion};
#[cfg(feature = "depth-models")]
use lo_imaging::Image;
use lo_imaging::{BlackBars, DepthMap, PhotoFile, SpecialProjection};
use lo_scene::{CameraSource, DistortedPhoto, Frame, FrameError, Undistortion};

use crate::{EstimateError, EstimateWarning, Estimator, Input};

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
    /// Distortion of the camera's lens. It is undone: the estimate has an undistorted photo.
    pub distortion: Option<Distortion>,
    /// Source of the depth. A depth map has the photo's distortion.
    pub depth: DepthSource,
}

/// Aspects from which a photo may be a stitched panorama, of landscape and of portrait photos. Phones' screenshots have
/// up to 2.33.
const WIDE: [f64; 2] = [2.2, 2.5];

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
    Model(Arc<DepthModel>),
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
    /// The photo before its distortion was undone.
    ///
    /// It belongs into [`EstimateOptions::distorted`](crate::EstimateOptions::distorted).
    pub distorted: Option<Arc<DistortedPhoto>>,
}

impl Estimator {
    /// Determines the camera of a photo, runs its depth model, if it has one, and fits inverse depth.
    ///
    /// # Errors
    /// - [`EstimateError::Projection`] if the camera is not given and the photo is that of no pinhole camera.
    /// - [`EstimateError::Undistortion`] if the distortion cannot be undone.
    /// - [`EstimateError::Frame`] if the photo has no pixels, or photo and depth do not form a [`Frame`].
    /// - With [`DepthSource::Model`], the errors of `Estimator::predict_depth`; with [`DepthSource::Inverse`], those of
    ///   its relative depth.
    /// - [`EstimateError::Cancelled`] if `on_event` breaks off.
    pub fn resolve(&self, request: PhotoRequest, on_event: OnEvent<'_>) -> Result<ResolvedPhoto, EstimateError> {
        let PhotoRequest { mut photo, camera, distortion, depth } = request;
        for note in std::mem::take(&mut photo.notes) {
            warn(on_event, EstimateWarning::PhotoFile(note))?;
        }
        if camera.is_none() && distortion.is_none() {
            check_projection(&photo, on_event)?;
        }
        if let Some(distortion) = distortion {
            let request = PhotoRequest { photo, camera, distortion: None, depth };
            return self.resolve_distorted(request, distortion, on_event);
        }
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
            return Ok(ResolvedPhoto {
                input: Input::PredictedDepth(predicted),
                camera,
                camera_source,
                distorted: None,
            });
        }
        let (camera, camera_source) = self.given_or_found_camera(&photo, camera)?;
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
        Ok(ResolvedPhoto { input, camera, camera_source, distorted: None })
    }

    /// Undoes the distortion of a photo and its depth map, and resolves the rest.
    fn resolve_distorted(
        &self,
        request: PhotoRequest,
        distortion: Distortion,
        on_event: OnEvent<'_>,
    ) -> Result<ResolvedPhoto, EstimateError> {
        let PhotoRequest { mut photo, camera, depth, .. } = request;
        let (camera, camera_source) = self.given_or_found_camera(&photo, camera)?;
        let undistortion = Undistortion::new(camera, distortion)?;
        let [hfov_deg, pinhole_hfov_deg] = [&undistortion.camera, &camera].map(Camera::hfov_deg);
        warn(on_event, EstimateWarning::Undistorted { hfov_deg, pinhole_hfov_deg })?;
        let undistorted = undistortion.photo(&photo.photo);
        let distorted = DistortedPhoto::new(std::mem::replace(&mut photo.photo, undistorted), undistortion);
        let distorted = Some(Arc::new(distorted));
        let depth = match depth {
            DepthSource::Measured(depth_m) => DepthSource::Measured(undistortion.depth(&depth_m)),
            DepthSource::Predicted(depth_m) => DepthSource::Predicted(undistortion.depth(&depth_m)),
            #[cfg(feature = "depth-models")]
            DepthSource::Inverse(inverse) => DepthSource::Inverse(undistortion.depth(&inverse)),
            undistorted => undistorted,
        };
        let request = PhotoRequest { photo, camera: Some(undistortion.camera), distortion: None, depth };
        self.resolve(request, on_event).map(|resolved| ResolvedPhoto { camera_source, distorted, ..resolved })
    }

    /// Returns the given camera, or determines it with its source.
    fn given_or_found_camera(
        &self,
        photo: &PhotoFile,
        given: Option<Camera>,
    ) -> Result<(Camera, Option<CameraSource>), EstimateError> {
        match given {
            Some(camera) => Ok((camera, None)),
            None => {
                let (camera, source) = self.camera_of(photo).map_err(FrameError::from)?;
                Ok((camera, Some(source)))
            }
        }
    }
}

/// Rejects photos that no pinhole camera takes, and warns about those that may be none.
fn check_projection(file: &PhotoFile, on_event: OnEvent<'_>) -> Result<(), EstimateError> {
    if let Some(panorama) = &file.panorama {
        let whole = panorama.is_full();
        let projection = if whole { SpecialProjection::Equirectangular } else { SpecialProjection::Panorama };
        return Err(EstimateError::Projection(projection));
    }
    let photo = &file.photo;
    // A disc in black could be taken for a picture between bars.
    let fisheye = SpecialProjection::of(photo)
        .filter(|found| matches!(found, SpecialProjection::Fisheye | SpecialProjection::DualFisheye));
    let bars = BlackBars::of(photo);
    let picture = bars.map(|bars| bars.cropped(photo));
    let picture = picture.as_ref().unwrap_or(photo);
    if let Some(projection) = fisheye.or_else(|| SpecialProjection::of(picture)) {
        return Err(EstimateError::Projection(projection));
    }
    let (width, height) = (picture.width() as f64, picture.height() as f64);
    let (aspect, limit) = if width > height { (width / height, WIDE[0]) } else { (height / width, WIDE[1]) };
    // Between bars, it is a frame of a film.
    if aspect >= limit && bars.is_none() {
        warn(on_event, EstimateWarning::WidePhoto { aspect })?;
    }
    Ok(())
}
