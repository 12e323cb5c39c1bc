//! The photo with its depth, at the resolutions that estimation works at.

use lo_completion::up_from_predicted_depth;
use lo_events::{OnEvent, Stage, Warning, stage, warn};
use lo_geometry::{Camera, Vec3};
use lo_imaging::{Image, Photo, srgb8_from_linear};
use lo_nets::depth::LONGER_SIDE;
use lo_nets::{GlobalLight, Networks};
use lo_scene::{Frame, working_photo};

use crate::{EstimateError, Input};

/// A photo with depth, at full and at working resolution.
pub(crate) struct View {
    pub frame: Frame,
    pub working: Frame,
    /// What the photo tells of the light outside of it, where that is known already.
    pub global: Option<GlobalLight>,
    /// Whether depth is some network's.
    pub predicted_depth: bool,
}

impl View {
    /// Of what an estimate starts from.
    pub fn new(input: Input, networks: Option<&Networks>, on_event: OnEvent<'_>) -> Result<Self, EstimateError> {
        let (frame, predicted_depth) = match input {
            Input::Photo { photo, camera } => {
                let networks = networks.ok_or(EstimateError::NoNetworks("a photo without depth"))?;
                return predicted(photo, camera, networks, on_event);
            }
            Input::MeasuredDepth(frame) => (frame, false),
            Input::PredictedDepth(frame) => (frame, true),
        };
        let working = stage(on_event, Stage::WorkingResolution, || frame.working())?;
        if predicted_depth {
            warn(on_event, Warning::PredictedDepth)?;
        }
        Ok(Self { frame, working, global: None, predicted_depth })
    }

    /// Unit vector against gravity where depth is predicted: floors are wavy then, and how cameras are held counts too.
    pub fn up(&self) -> Option<Vec3> {
        let voting = || {
            let depth_m = &self.frame.depth_m;
            let longer = depth_m.width().max(depth_m.height());
            if longer <= LONGER_SIDE {
                return up_from_predicted_depth(&self.frame);
            }
            // The weights of the votes are set for normals as coarse as the own network's.
            let side = |pixels: usize| (pixels * LONGER_SIDE).div_ceil(longer).max(1);
            let depth_m = lo_imaging::resize_depth(depth_m, side(depth_m.width()), side(depth_m.height()));
            up_from_predicted_depth(&Frame { depth_m, ..self.working.clone() })
        };
        self.predicted_depth.then(voting)
    }
}

/// A photo whose depth is the depth network's.
fn predicted(photo: Photo, camera: Camera, networks: &Networks, on_event: OnEvent<'_>) -> Result<View, EstimateError> {
    let small = stage(on_event, Stage::WorkingResolution, || working_photo(&photo))?;
    let (depth_m, global) =
        stage(on_event, Stage::DepthAndGlobalLight, || networks.depth_and_light(&srgb8(&small), &camera))?;
    if !depth_m.pixels().iter().all(|z| z.is_finite()) {
        return Err(EstimateError::PredictedDepth);
    }
    let frame = Frame::new(photo, depth_m, camera, 1.0)?;
    let depth_m = lo_imaging::resize_depth(&frame.depth_m, small.width(), small.height());
    let camera = frame.camera.resized(small.width() as u32, small.height() as u32);
    let working = Frame { camera, photo: small, depth_m, exposure: 1.0 };
    warn(on_event, Warning::PredictedDepth)?;
    Ok(View { frame, working, global: Some(global), predicted_depth: true })
}

/// As the networks take photos.
pub(crate) fn srgb8(photo: &Photo) -> Image<[u8; 3]> {
    match photo {
        Photo::Srgb8(image) => image.clone(),
        Photo::Linear(image) => image.map(|rgb| rgb.map(srgb8_from_linear)),
    }
}
