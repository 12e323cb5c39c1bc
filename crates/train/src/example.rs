//! From a sample to what a step of training needs.

use cone::{ConeTracer, Settings};
use dataset::Sample;
use geometry::{Cube, Mat3, Vec3};
use imaging::{DepthMap, Image, Photo, RadianceImage, linear_from_srgb8, srgb8_from_linear};
use lightoctree::SeenFrame;
use nets::light::{LightInput, LightNetConfig, Rays};
use octree::LightOctree;
use random::{RngExt, Stream};
use scene::Frame;

use crate::augmentation::{Variation, varied_rays};
use crate::true_octree;

/// Size of the panorama that the depth network's global lighting decoder gives.
pub(crate) const PANORAMA: (usize, usize) = (128, 64);

/// Depth of the octree that the true panorama at the camera is rendered from: its leaves are as large as the panorama's pixels at 4 m.
const PANORAMA_DEPTH: u32 = 6;

/// Photo values from this on count as clipped where rays of the photo are compared, as in [`Frame::clipped`].
const WHITE: f32 = 0.956;

/// Why a sample is passed over.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum Unusable {
    /// It lacks something.
    #[error("it has no {0}")]
    Missing(&'static str),
    /// Photo and depth make no frame, or its octree cannot be.
    #[error("{0}")]
    Impossible(String),
}

fn impossible(reason: impl ToString) -> Unusable {
    Unusable::Impossible(reason.to_string())
}

/// What a step of the depth network needs.
#[derive(Debug)]
pub(crate) struct DepthExample {
    pub photo: Image<[u8; 3]>,
    /// True depth of the same size.
    pub depth_m: DepthMap,
    /// The true panorama at the camera, of size [`PANORAMA`].
    pub panorama: RadianceImage,
    /// What the photo shows of it: radiance times share, share.
    pub shown: Image<[f32; 4]>,
}

impl DepthExample {
    pub fn new(sample: &Sample, variation: &Variation, width: usize) -> Result<Self, Unusable> {
        let depth_m = variation.depth(sample.depth_m.as_ref().ok_or(Unusable::Missing("true depth"))?);
        if sample.points.is_empty() {
            return Err(Unusable::Missing("surface points"));
        }
        let photo = variation.photo(&sample.photo);
        // A wrong focal length is the light network's matter: the picture itself is of the true camera.
        let variation = Variation { focal: 1.0, ..*variation };
        let camera = variation.camera(&sample.camera);
        let points = variation.points(&sample.points);
        let low = points.iter().map(|p| p.position_m).fold(Vec3::ZERO, Vec3::min);
        let high = points.iter().map(|p| p.position_m).fold(Vec3::ZERO, Vec3::max);
        let cube = Cube::centred(0.5 * (low + high), 1.01 * (high - low).max_element());
        let (octree, _) = LightOctree::from_points(&points, cube, PANORAMA_DEPTH, 4).map_err(impossible)?;
        let tracer = ConeTracer::new(&octree, Settings::default()).map_err(impossible)?;
        let panorama = tracer.panorama(Vec3::ZERO, PANORAMA.0, PANORAMA.1).radiance;
        let linear = photo.map(|rgb| rgb.map(linear_from_srgb8));
        let camera = camera.resized(photo.width() as u32, photo.height() as u32);
        let shown = imaging::equirectangular_from_perspective(&linear, &camera, Mat3::IDENTITY, PANORAMA.0, PANORAMA.1);
        let width = width.min(photo.width());
        let height = (photo.height() * width).div_ceil(photo.width());
        let photo = if width < photo.width() {
            imaging::resize(&linear, width, height).map(|rgb| rgb.map(srgb8_from_linear))
        } else {
            photo
        };
        let depth_m = imaging::resize_depth(&depth_m, width, height);
        Ok(Self { photo, depth_m, panorama, shown })
    }
}

/// What a step of the light network needs.
#[derive(Debug)]
pub(crate) struct LightExample {
    pub input: LightInput,
    pub truth: LightOctree,
    /// Rays of novel views.
    pub novel: Rays,
    /// Rays of the photo.
    pub visible: Rays,
}

/// How many rays a step compares.
#[derive(Clone, Copy, Debug)]
pub(crate) struct RayCounts {
    pub novel: usize,
    pub visible: usize,
}

/// Where the depth of what is seen comes from.
#[derive(Clone, Copy, Debug)]
pub(crate) enum KnownDepth<'a> {
    True,
    /// The true one where there is no sensor's.
    Sensor,
    /// A prediction, of the varied photo.
    Predicted(&'a DepthMap),
}

impl LightExample {
    /// With the photo that the frame was made of.
    pub fn new(
        sample: &Sample,
        variation: &Variation,
        depth: KnownDepth,
        network: &LightNetConfig,
        rays: RayCounts,
        stream: &mut Stream,
    ) -> Result<Self, Unusable> {
        let room = VariedRoom::new(sample, variation, depth)?;
        let input = room.input(network, stream.random())?;
        let truth = room.truth(network)?;
        let novel = Rays::of_panoramas(&sample.views, rays.novel, stream);
        let novel = varied_rays(novel, variation, room.scale, room.seen.cube);
        let visible = room.visible_rays(sample, variation, rays.visible, stream);
        Ok(Self { input, truth, novel, visible })
    }
}

/// A sample's room as the light network has to see it.
pub(crate) struct VariedRoom {
    pub seen: SeenFrame,
    /// The frame at the working resolution.
    pub working: Frame,
    points: Vec<octree::RadiancePoint>,
    /// The room is larger than the true one by this factor: that of predicted depth. Its octree has to agree with what is seen.
    pub scale: f32,
}

impl VariedRoom {
    pub fn new(sample: &Sample, variation: &Variation, depth: KnownDepth) -> Result<Self, Unusable> {
        if sample.points.is_empty() {
            return Err(Unusable::Missing("surface points"));
        }
        let truth = || sample.depth_m.as_ref().ok_or(Unusable::Missing("true depth"));
        let (depth_m, scale) = match depth {
            KnownDepth::True => (variation.depth(truth()?), 1.0),
            KnownDepth::Sensor => match &sample.sensor_depth_m {
                Some(sensor) => (variation.depth(sensor), 1.0),
                None => (variation.depth(truth()?), 1.0),
            },
            KnownDepth::Predicted(predicted) => {
                (predicted.clone(), median_ratio(predicted, &variation.depth(truth()?)))
            }
        };
        let photo = Photo::Srgb8(variation.photo(&sample.photo));
        let frame = Frame::new(photo, depth_m, variation.camera(&sample.camera), 1.0).map_err(impossible)?;
        let working = frame.working();
        let seen = SeenFrame::new(&working).ok_or(Unusable::Missing("depth reading that is not a flying pixel's"))?;
        let mut points = variation.points(&sample.points);
        points.iter_mut().for_each(|point| point.position_m *= scale);
        Ok(Self { seen, working, points, scale })
    }

    /// The light network's input.
    pub fn input(&self, network: &LightNetConfig, seed: u64) -> Result<LightInput, Unusable> {
        let SeenFrame { points, camera, cube, .. } = &self.seen;
        LightInput::new(points, camera, *cube, network, seed).map_err(impossible)
    }

    /// What it ought to give.
    pub fn truth(&self, network: &LightNetConfig) -> Result<LightOctree, Unusable> {
        true_octree(&self.points, self.seen.cube, network.depth, network.full_depth).map_err(impossible)
    }

    fn visible_rays(&self, sample: &Sample, variation: &Variation, count: usize, stream: &mut Stream) -> Rays {
        let Some(depth_m) = &sample.depth_m else { return Rays::from_iter([]) };
        let photo = self.working.radiance();
        let depth_m = imaging::resize_depth(&variation.depth(depth_m), photo.width(), photo.height());
        let rays = Rays::of_photo(&photo, &depth_m, &self.working.camera, WHITE, count, stream);
        // The camera is the believed one already; depth is true and only has to follow the room's scale.
        varied_rays(rays, &Variation::NONE, self.scale, self.seen.cube)
    }
}

/// e^median of log(a / b) where both are known.
fn median_ratio(a: &DepthMap, b: &DepthMap) -> f32 {
    let b = imaging::resize_depth(b, a.width(), a.height());
    let known = a.pixels().iter().zip(b.pixels()).filter(|(a, b)| **a > 0.0 && **b > 0.0);
    let mut ratios: Vec<f32> = known.map(|(a, b)| a / b).filter(|ratio| ratio.is_finite()).collect();
    if ratios.is_empty() {
        return 1.0;
    }
    let middle = ratios.len() / 2;
    *ratios.select_nth_unstable_by(middle, f32::total_cmp).1
}
