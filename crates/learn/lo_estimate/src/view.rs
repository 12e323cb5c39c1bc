//! The photo with its depth, at the resolutions that estimation works at.

use lo_completion::{up_from_predicted_depth, up_near};
use lo_events::{OnEvent, Stage, Warning, stage, warn};
use lo_geometry::{Camera, PerspectiveFit, RigidTransform, Vec3};
use lo_imaging::{Image, Photo, srgb8_from_linear};
use lo_nets::{GlobalLight, Networks, PhotoPrediction};
use lo_scene::{Frame, ObservedPhoto, OtherPhoto, PosedFrame, Surfel, working_photo};

use crate::photos::{Together, together};
use crate::{EstimateError, Exposures, Input, PredictedDepth};

/// Pixels on the longer side of the normals that vote for which way is up: the weights of the votes are set for normals as coarse as that.
const VOTING_SIDE: usize = 240;

/// A photo with depth, at full and at working resolution.
pub(crate) struct View {
    pub frame: Frame,
    pub working: Frame,
    /// Other photos of the room, at working resolution, and their cameras at full resolution.
    pub others: Vec<(PosedFrame, Camera)>,
    /// What the photo tells of the light outside of it, where that is known already.
    pub global: Option<GlobalLight>,
    /// How the own network says that the camera was held; known with `global`.
    held: Option<PerspectiveFit>,
    /// Whether depth is some network's.
    pub predicted_depth: bool,
    /// What people call that network, where it is not the own one.
    pub model: Option<String>,
    /// Normals that it told, of any resolution and of the working one.
    told_normals: Option<Image<Vec3>>,
    pub normals: Option<Image<Option<Vec3>>>,
}

impl View {
    /// Of what an estimate starts from.
    pub fn new(input: Input, networks: Option<&Networks>, on_event: OnEvent<'_>) -> Result<Self, EstimateError> {
        let (PredictedDepth { frame, normals, model }, predicted_depth) = match input {
            Input::Photo { photo, camera } => {
                let networks = networks.ok_or(EstimateError::NoNetworks("a photo without depth"))?;
                return predicted(photo, camera, networks, on_event);
            }
            Input::MeasuredDepth(frame) => (frame.into(), false),
            Input::PredictedDepth(predicted) => (predicted, true),
            Input::Photos { photos, exposures } => return several(photos, exposures, on_event),
        };
        let working = stage(on_event, Stage::WorkingResolution, || frame.working())?;
        if predicted_depth {
            warn(on_event, Warning::PredictedDepth)?;
        }
        let of_working = |normals| at_size(normals, working.depth_m.width(), working.depth_m.height());
        let of_working = normals.as_ref().map(of_working);
        let others = Vec::new();
        Ok(Self {
            frame,
            working,
            others,
            global: None,
            held: None,
            predicted_depth,
            model,
            told_normals: normals,
            normals: of_working,
        })
    }

    /// All photos at working resolution, each with its camera's place in the first one's axes.
    pub fn photos(&self) -> Vec<(&Frame, RigidTransform)> {
        let others = self.others.iter().map(|(other, _)| (&other.frame, other.first_from_camera));
        std::iter::once((&self.working, RigidTransform::IDENTITY)).chain(others).collect()
    }

    /// All photos as completion looks at them.
    pub fn seen_photos(&self) -> Vec<ObservedPhoto> {
        let mut seen: Vec<ObservedPhoto> =
            self.photos().into_iter().map(|(frame, pose)| ObservedPhoto::new(frame, pose)).collect();
        if let Some(told) = &self.normals {
            seen[0].override_normals(told);
        }
        seen
    }

    /// What a scene keeps of the photos after the first.
    pub fn other_photos(&self) -> Vec<OtherPhoto> {
        let kept = |(other, camera): &(PosedFrame, Camera)| OtherPhoto {
            first_from_camera: other.first_from_camera,
            camera: *camera,
            exposure: other.frame.exposure,
        };
        self.others.iter().map(kept).collect()
    }

    /// Unit vector against gravity, and by how many degrees it is likely to be wrong where the own network tells it alone.
    ///
    /// Predicted floors are wavy: the network tells it. Measured ones are not, and decide among what is near to that. `None` where there is no network
    /// that has learned it, and depth is measured.
    pub fn up(
        &mut self,
        networks: Option<&Networks>,
        on_event: OnEvent<'_>,
    ) -> Result<Option<(Vec3, Option<f64>)>, EstimateError> {
        // Normals that are told are nearer to what is up than the photo alone.
        if self.predicted_depth && self.told_normals.is_some() {
            return Ok(Some((self.voted_up(), None)));
        }
        if let Some(networks) = networks.filter(|_| self.global.is_none()) {
            let extent = self.frame.camera.half_extent();
            let ask = || networks.light_and_camera(&srgb8(&self.working.photo), extent);
            let (global, held) = stage(on_event, Stage::GlobalLight, ask)?;
            (self.global, self.held) = (Some(global), held);
        }
        Ok(match self.held {
            Some(held) if self.predicted_depth => Some((held.camera.up, Some(held.up_deviation_deg))),
            Some(held) => {
                let seen: Vec<Surfel> = self.seen_photos().iter().flat_map(ObservedPhoto::surfels).collect();
                Some((up_near(&seen, held.camera.up, held.up_deviation_deg as f32), None))
            }
            None => self.predicted_depth.then(|| (self.voted_up(), None)),
        })
    }

    /// As surfaces and the ways in which cameras are held make it likely.
    fn voted_up(&self) -> Vec3 {
        let depth_m = &self.frame.depth_m;
        let told = |width, height| self.told_normals.as_ref().map(|normals| at_size(normals, width, height));
        let longer = depth_m.width().max(depth_m.height());
        if longer <= VOTING_SIDE {
            return up_from_predicted_depth(&self.frame, told(depth_m.width(), depth_m.height()).as_ref());
        }
        let side = |pixels: usize| (pixels * VOTING_SIDE).div_ceil(longer).max(1);
        let depth_m = lo_imaging::resize_depth(depth_m, side(depth_m.width()), side(depth_m.height()));
        let normals = told(depth_m.width(), depth_m.height());
        up_from_predicted_depth(&Frame { depth_m, ..self.working.clone() }, normals.as_ref())
    }
}

/// A photo whose depth is the depth network's.
fn predicted(photo: Photo, camera: Camera, networks: &Networks, on_event: OnEvent<'_>) -> Result<View, EstimateError> {
    let small = stage(on_event, Stage::WorkingResolution, || working_photo(&photo))?;
    let PhotoPrediction { depth_m, light: global, perspective: held } =
        stage(on_event, Stage::DepthAndGlobalLight, || networks.predict(&srgb8(&small), &camera))?;
    if !depth_m.pixels().iter().all(|z| z.is_finite()) {
        return Err(EstimateError::PredictedDepth);
    }
    let frame = Frame::new(photo, depth_m, camera, 1.0)?;
    let depth_m = lo_imaging::resize_depth(&frame.depth_m, small.width(), small.height());
    let camera = frame.camera.resized(small.width() as u32, small.height() as u32);
    let working = Frame { camera, photo: small, depth_m, exposure: 1.0 };
    warn(on_event, Warning::PredictedDepth)?;
    let (others, global, predicted_depth) = (Vec::new(), Some(global), true);
    Ok(View { frame, working, others, global, held, predicted_depth, model: None, told_normals: None, normals: None })
}

/// Normals at another resolution: those of the nearest pixels.
fn at_size(normals: &Image<Vec3>, width: usize, height: usize) -> Image<Option<Vec3>> {
    let at = |index: usize, size: usize, of: usize| (2 * index + 1) * of / (2 * size);
    Image::from_fn(width, height, |x, y| {
        let normal = normals[(at(x, width, normals.width()), at(y, height, normals.height()))];
        (normal != Vec3::ZERO).then_some(normal)
    })
}

/// Photos with measured depth of one room.
fn several(photos: Vec<PosedFrame>, exposures: Exposures, on_event: OnEvent<'_>) -> Result<View, EstimateError> {
    let Together { photos, working } = together(photos, exposures, on_event)?;
    let cameras: Vec<Camera> = photos.iter().skip(1).map(|photo| photo.frame.camera).collect();
    let mut working = working.into_iter();
    let (Some(first), Some(first_working)) = (photos.into_iter().next(), working.next()) else {
        return Err(EstimateError::NoPhotos);
    };
    let others = working.zip(cameras).collect();
    let (frame, working) = (first.frame, first_working.frame);
    let (global, held, predicted_depth) = (None, None, false);
    Ok(View { frame, working, others, global, held, predicted_depth, model: None, told_normals: None, normals: None })
}

/// As the networks take photos.
pub(crate) fn srgb8(photo: &Photo) -> Image<[u8; 3]> {
    match photo {
        Photo::Srgb8(image) => image.clone(),
        Photo::Linear(image) => image.map(|rgb| rgb.map(srgb8_from_linear)),
    }
}
