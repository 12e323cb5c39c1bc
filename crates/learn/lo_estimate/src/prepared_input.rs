//! Photos with depth, prepared at the resolutions of the estimation.

use std::sync::OnceLock;

use lo_completion::{up_from_predicted_depth, up_near};
use lo_events::{OnEvent, stage, warn};
use lo_geometry::{Camera, PerspectiveFit, Vec3};
use lo_imaging::{Image, Photo};
use lo_nets::{GlobalLight, Networks, PhotoPrediction};
use lo_scene::{Frame, ObservedPhoto, OtherPhoto, PosedFrame, Surfel, working_photo};

use crate::given_depth::compare;
use crate::photos::{AlignedPhotos, align_photos};
use crate::{EstimateError, EstimateWarning, Exposures, Input, PredictedDepth, stages};

/// Pixels on the longer side of the normals that vote for up. The votes' weights are tuned for this resolution.
const VOTING_SIDE: usize = 240;

/// The photos of an estimate with their depth, at full and at working resolution.
pub(crate) struct PreparedInput {
    /// The first photo at full resolution.
    pub frame: Frame,
    /// The first photo at working resolution.
    pub working: Frame,
    /// The other photos at working resolution, with their cameras at full resolution.
    pub others: Vec<(PosedFrame, Camera)>,
    /// Global light predicted from the first photo, if the network has run.
    pub global: Option<GlobalLight>,
    /// Camera orientation predicted with `global`, if the network was trained for it.
    perspective: Option<PerspectiveFit>,
    /// Whether depth was predicted by a network.
    pub predicted_depth: bool,
    /// Display name of that network, if it is not the own one.
    pub model: Option<String>,
    /// Normals predicted by that network, at its resolution.
    predicted_normals: Option<Image<Vec3>>,
    /// These normals at working resolution.
    normals: Option<Image<Option<Vec3>>>,
    /// [`Self::observed`], once computed.
    observed: OnceLock<Vec<ObservedPhoto>>,
}

impl PreparedInput {
    /// Predicts depth if there is none, and reduces photos to working resolution.
    pub fn new(input: Input, networks: Option<&Networks>, on_event: OnEvent<'_>) -> Result<Self, EstimateError> {
        let (PredictedDepth { frame, normals, model }, predicted_depth) = match input {
            Input::Photo { photo, camera } => {
                let networks = networks.ok_or(EstimateError::NoNetworks("a photo without depth"))?;
                return with_predicted_depth(photo, camera, networks, on_event);
            }
            Input::MeasuredDepth(frame) => (frame.into(), false),
            Input::PredictedDepth(predicted) => (predicted, true),
            Input::Photos { photos, exposures } => return from_photos(photos, exposures, networks, on_event),
        };
        let working = stage(on_event, stages::WORKING_RESOLUTION, || frame.working())?;
        if predicted_depth {
            warn(on_event, EstimateWarning::PredictedDepth)?;
        }
        let at_working = |normals| at_size(normals, working.depth_m.width(), working.depth_m.height());
        let working_normals = normals.as_ref().map(at_working);
        let others = Vec::new();
        let mut prepared = Self {
            frame,
            working,
            others,
            global: None,
            perspective: None,
            predicted_depth,
            model,
            predicted_normals: normals,
            normals: working_normals,
            observed: OnceLock::new(),
        };
        if let Some(networks) = networks.filter(|_| prepared.model.is_none()) {
            prepared.compare_depth(networks, on_event)?;
        }
        Ok(prepared)
    }

    /// Compares given depth with the own network's, and warns if they contradict each other.
    ///
    /// The network predicts global light and the camera's orientation in the same pass; both are kept.
    fn compare_depth(&mut self, networks: &Networks, on_event: OnEvent<'_>) -> Result<(), EstimateError> {
        let predict = || networks.predict(&self.working.photo.srgb8(), &self.frame.camera);
        let PhotoPrediction { depth_m, light, perspective } = stage(on_event, stages::DEPTH_AND_GLOBAL_LIGHT, predict)?;
        (self.global, self.perspective) = (Some(light), perspective);
        compare(&self.working.depth_m, &depth_m).into_iter().try_for_each(|warning| warn(on_event, warning))?;
        Ok(())
    }

    /// Returns all photos at working resolution.
    pub fn working_frames(&self) -> Vec<&Frame> {
        std::iter::once(&self.working).chain(self.others.iter().map(|(other, _)| &other.frame)).collect()
    }

    /// Returns all photos in the form that completion takes. Computed once.
    pub fn observed(&self) -> &[ObservedPhoto] {
        self.observed.get_or_init(|| {
            let first = ObservedPhoto::first(&self.working, self.normals.as_ref());
            let others = self.others.iter();
            let others = others.map(|(other, _)| ObservedPhoto::new(&other.frame, other.first_from_camera));
            std::iter::once(first).chain(others).collect()
        })
    }

    /// Returns what an estimate stores of the photos after the first.
    pub fn other_photos(&self) -> Vec<OtherPhoto> {
        let kept = |(other, camera): &(PosedFrame, Camera)| OtherPhoto {
            first_from_camera: other.first_from_camera,
            camera: *camera,
            exposure: other.frame.exposure,
        };
        self.others.iter().map(kept).collect()
    }

    /// Estimates the unit vector against gravity, with its expected error in degrees if only the own network predicts
    /// it.
    ///
    /// Predicted floors are wavy, so the network's prediction is used with predicted depth. With measured depth,
    /// surfaces near the prediction determine up. Returns `None` for measured depth without a network trained to
    /// predict up.
    pub fn up(
        &mut self,
        networks: Option<&Networks>,
        on_event: OnEvent<'_>,
    ) -> Result<Option<(Vec3, Option<f64>)>, EstimateError> {
        // Predicted normals determine up more accurately than the photo alone.
        if self.predicted_depth && self.predicted_normals.is_some() {
            return Ok(Some((self.voted_up(), None)));
        }
        if let Some(networks) = networks.filter(|_| self.global.is_none()) {
            let extent = self.frame.camera.half_extent();
            let predict = || networks.light_and_camera(&self.working.photo.srgb8(), extent);
            let (global, perspective) = stage(on_event, stages::GLOBAL_LIGHT, predict)?;
            (self.global, self.perspective) = (Some(global), perspective);
        }
        Ok(match self.perspective {
            Some(fit) if self.predicted_depth => Some((fit.camera.up, Some(fit.up_deviation_deg))),
            Some(fit) => {
                let seen: Vec<Surfel> = self.observed().iter().flat_map(ObservedPhoto::surfels).collect();
                Some((up_near(&seen, fit.camera.up, fit.up_deviation_deg as f32), None))
            }
            None => self.predicted_depth.then(|| (self.voted_up(), None)),
        })
    }

    /// Estimates up from predicted depth and normals, and typical camera poses.
    fn voted_up(&self) -> Vec3 {
        let depth_m = &self.frame.depth_m;
        let resized = |width, height| self.predicted_normals.as_ref().map(|normals| at_size(normals, width, height));
        let longer = depth_m.width().max(depth_m.height());
        if longer <= VOTING_SIDE {
            return up_from_predicted_depth(&self.frame, resized(depth_m.width(), depth_m.height()).as_ref());
        }
        let side = |pixels: usize| (pixels * VOTING_SIDE).div_ceil(longer).max(1);
        let depth_m = lo_imaging::resize_depth(depth_m, side(depth_m.width()), side(depth_m.height()));
        let normals = resized(depth_m.width(), depth_m.height());
        up_from_predicted_depth(&Frame { depth_m, ..self.working.clone() }, normals.as_ref())
    }
}

/// Prepares a photo with depth predicted by the depth network.
fn with_predicted_depth(
    photo: Photo,
    camera: Camera,
    networks: &Networks,
    on_event: OnEvent<'_>,
) -> Result<PreparedInput, EstimateError> {
    let small = stage(on_event, stages::WORKING_RESOLUTION, || working_photo(&photo))?;
    let PhotoPrediction { depth_m, light: global, perspective } =
        stage(on_event, stages::DEPTH_AND_GLOBAL_LIGHT, || networks.predict(&small.srgb8(), &camera))?;
    if !depth_m.pixels().iter().all(|z| z.is_finite()) {
        return Err(EstimateError::NonFiniteDepth);
    }
    let frame = Frame::new(photo, depth_m, camera, 1.0)?;
    let depth_m = lo_imaging::resize_depth(&frame.depth_m, small.width(), small.height());
    let camera = frame.camera.resized(small.width() as u32, small.height() as u32);
    let working = Frame { camera, photo: small, depth_m, exposure: 1.0 };
    warn(on_event, EstimateWarning::PredictedDepth)?;
    let (others, global, predicted_depth) = (Vec::new(), Some(global), true);
    Ok(PreparedInput {
        frame,
        working,
        others,
        global,
        perspective,
        predicted_depth,
        model: None,
        predicted_normals: None,
        normals: None,
        observed: OnceLock::new(),
    })
}

/// Resamples normals to another resolution by nearest neighbour; zero becomes `None`.
fn at_size(normals: &Image<Vec3>, width: usize, height: usize) -> Image<Option<Vec3>> {
    let at = |index: usize, size: usize, of: usize| (2 * index + 1) * of / (2 * size);
    Image::from_fn(width, height, |x, y| {
        let normal = normals[(at(x, width, normals.width()), at(y, height, normals.height()))];
        (normal != Vec3::ZERO).then_some(normal)
    })
}

/// Prepares several photos of one room with measured depth.
fn from_photos(
    photos: Vec<PosedFrame>,
    exposures: Exposures,
    networks: Option<&Networks>,
    on_event: OnEvent<'_>,
) -> Result<PreparedInput, EstimateError> {
    let AlignedPhotos { photos, working } = align_photos(photos, exposures, on_event)?;
    let cameras: Vec<Camera> = photos.iter().skip(1).map(|photo| photo.frame.camera).collect();
    let mut working = working.into_iter();
    let (Some(first), Some(first_working)) = (photos.into_iter().next(), working.next()) else {
        return Err(EstimateError::NoPhotos);
    };
    let others = working.zip(cameras).collect();
    let (frame, working) = (first.frame, first_working.frame);
    let (global, perspective, predicted_depth) = (None, None, false);
    let mut prepared = PreparedInput {
        frame,
        working,
        others,
        global,
        perspective,
        predicted_depth,
        model: None,
        predicted_normals: None,
        normals: None,
        observed: OnceLock::new(),
    };
    // The depth of the other photos agrees with that of the first where they overlap.
    if let Some(networks) = networks {
        prepared.compare_depth(networks, on_event)?;
    }
    Ok(prepared)
}
