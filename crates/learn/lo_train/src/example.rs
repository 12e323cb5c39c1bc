//! From a sample to what a step of training needs.

use lo_cone::{ConeTracer, Settings};
use lo_dataset::{NovelView, Sample, TrueLeaves, true_octree};
use lo_estimate::SeenFrame;
use lo_geometry::{Camera, Cube, Mat3, Perspective, Vec3};
use lo_imaging::{DepthMap, Image, Photo, RadianceImage, linear_from_srgb8, srgb8_from_linear};
use lo_nets::depth::{DepthNet, size_within};
use lo_nets::expected::{ExpectedTruth, PhotoStatistics};
use lo_nets::light::{LightInput, LightNetConfig, Rays};
use lo_octree::LightOctree;
use lo_random::{RngExt, Stream};
use lo_scene::Frame;

use crate::augmentation::{Variation, varied_rays};
use crate::rays::drawn_panorama_rays;

/// Size of the panorama that the depth network's global lighting decoder gives.
pub(crate) const PANORAMA: (usize, usize) = (128, 64);

/// Depths of the octree that the true panorama at the camera is rendered from. At the greatest, leaves are as large as the panorama's pixels at 4 m.
const PANORAMA_DEPTHS: [u32; 2] = [3, 6];

/// Edge of that octree's leaves over the distance of surface points from each other, at least: smaller ones would leave holes.
const POINTS_IN_A_ROW: f32 = 1.25;

/// How far from the camera a panorama may stand and be taken for its own.
const MAX_ASIDE_M: f32 = 0.05;

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
    /// True depth of the same size; without readings where nothing is known.
    pub depth_m: DepthMap,
    /// The photo's.
    pub camera: Camera,
    /// How it was held, where that is known.
    pub perspective: Option<Perspective>,
    /// The true panorama at the camera, of size [`PANORAMA`], where it is known.
    pub panorama: Option<RadianceImage>,
}

impl DepthExample {
    pub fn new(sample: &Sample, variation: &Variation, longer_side: usize) -> Result<Self, Unusable> {
        let photo = variation.photo(&sample.photo);
        // A wrong focal length is the light network's matter: the picture itself is of the true camera.
        let variation = Variation { focal: 1.0, ..*variation };
        let panorama = true_panorama(sample, &variation)?;
        if panorama.is_none() && sample.depth_m.is_none() {
            return Err(Unusable::Missing("depth, nor a panorama at its camera"));
        }
        let depth_m = match &sample.depth_m {
            Some(depth_m) => variation.depth(depth_m),
            None => DepthMap::from_fn(photo.width(), photo.height(), |_, _| 0.0),
        };
        let camera = variation.camera(&sample.camera);
        let perspective = variation.up(sample).map(|up| Perspective { up, half_extent: camera.half_extent() });
        // Of the whole photo's shape, so that photos of one size are one batch however they are cut.
        let [width, height] = size_within([sample.photo.width(), sample.photo.height()], longer_side);
        let photo = if (width, height) == (photo.width(), photo.height()) {
            photo
        } else {
            let linear = photo.map(|rgb| rgb.map(linear_from_srgb8));
            lo_imaging::resize(&linear, width, height).map(|rgb| rgb.map(srgb8_from_linear))
        };
        let depth_m = lo_imaging::resize_depth(&depth_m, width, height);
        let camera = camera.resized(photo.width() as u32, photo.height() as u32);
        Ok(Self { photo, depth_m, camera, perspective, panorama })
    }

    /// Width and height of the photo.
    pub fn size(&self) -> [usize; 2] {
        [self.photo.width(), self.photo.height()]
    }

    /// What the photo shows of the panorama: radiance times share, share.
    pub fn shown(&self) -> Image<[f32; 4]> {
        let linear = self.photo.map(|rgb| rgb.map(linear_from_srgb8));
        lo_imaging::equirectangular_from_perspective(&linear, &self.camera, Mat3::IDENTITY, PANORAMA.0, PANORAMA.1)
    }

    /// What the depth network ought to say, but for the logarithm.
    pub fn extent_m(&self) -> DepthMap {
        let extent = self.camera.half_extent() as f32;
        self.depth_m.map(|z| z * extent)
    }
}

/// The panorama at the camera: the one that was taken there, if one was, else from the room's surfaces, where they are known.
fn true_panorama(sample: &Sample, variation: &Variation) -> Result<Option<RadianceImage>, Unusable> {
    let (width, height) = PANORAMA;
    let here = |view: &&NovelView| view.position_m.length() < MAX_ASIDE_M;
    if let Some(view) = sample.views.iter().find(here) {
        let turned = lo_imaging::rotate_equirectangular(&view.radiance, view.rotation, width, height);
        let column = |x: usize| if variation.mirrored { width - 1 - x } else { x };
        return Ok(Some(Image::from_fn(width, height, |x, y| variation.light(turned[(column(x), y)]))));
    }
    if sample.points.is_empty() {
        return Ok(None);
    }
    let points = variation.points(&sample.points);
    let low = points.iter().map(|p| p.position_m).fold(Vec3::ZERO, Vec3::min);
    let high = points.iter().map(|p| p.position_m).fold(Vec3::ZERO, Vec3::max);
    let cube = Cube::centred(0.5 * (low + high), 1.01 * (high - low).max_element());
    let spacing_m = sample.point_area_m2.map_or(0.0, f32::sqrt);
    let [coarse, fine] = PANORAMA_DEPTHS;
    let closed = |depth: &u32| cube.node_edge_m(*depth) >= POINTS_IN_A_ROW * spacing_m;
    let depth = (coarse..=fine).rev().find(closed).unwrap_or(coarse);
    let (octree, _) = LightOctree::from_points(&points, cube, depth, coarse).map_err(impossible)?;
    let tracer = ConeTracer::new(&octree, Settings::default()).map_err(impossible)?;
    Ok(Some(tracer.panorama(Vec3::ZERO, width, height).radiance))
}

/// What a step of the network of expected light needs.
#[derive(Debug)]
pub(crate) struct ExpectedExample {
    pub statistics: PhotoStatistics,
    pub truth: ExpectedTruth,
}

impl ExpectedExample {
    /// With depth as this network predicts it.
    pub fn new(sample: &Sample, variation: &Variation, depth_net: &DepthNet) -> Result<Self, Unusable> {
        let example = DepthExample::new(sample, variation, depth_net.longer_side())?;
        let panorama = example.panorama.ok_or(Unusable::Missing("panorama at its camera"))?;
        let Perspective { up, .. } = example.perspective.ok_or(Unusable::Missing("direction of up"))?;
        let depth_m = depth_net.forward(&[&example.photo]).depth_m(&example.camera);
        let photo = example.photo.map(|rgb| rgb.map(linear_from_srgb8));
        let statistics = PhotoStatistics::new(&photo, &depth_m, &example.camera, up);
        let truth = ExpectedTruth::new(&panorama, &example.camera, &statistics, false);
        Ok(Self { statistics, truth })
    }
}

/// What a step of the light network needs.
#[derive(Debug)]
pub(crate) struct LightExample {
    /// Of the points alone.
    pub input: LightInput,
    /// Unit vector against gravity.
    pub up: Vec3,
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
        let novel = drawn_panorama_rays(&sample.views, rays.novel, stream);
        let novel = varied_rays(novel, variation, room.scale, room.seen.cube);
        let visible = room.visible_rays(sample, variation, rays.visible, stream);
        Ok(Self { input, up: room.seen.room.up, truth, novel, visible })
    }
}

/// A sample's room as the light network has to see it.
pub(crate) struct VariedRoom {
    pub seen: SeenFrame,
    /// The frame at the working resolution.
    pub working: Frame,
    points: Vec<lo_octree::RadiancePoint>,
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
        let seen = SeenFrame::new(&working, variation.up(sample), None)
            .ok_or(Unusable::Missing("depth reading that is not a flying pixel's"))?;
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
        let SeenFrame { cube, .. } = self.seen;
        true_octree(&self.points, TrueLeaves::All, cube, network.depth, network.full_depth).map_err(impossible)
    }

    fn visible_rays(&self, sample: &Sample, variation: &Variation, count: usize, stream: &mut Stream) -> Rays {
        let Some(depth_m) = &sample.depth_m else { return Rays::from_iter([]) };
        let photo = self.working.radiance();
        let depth_m = lo_imaging::resize_depth(&variation.depth(depth_m), photo.width(), photo.height());
        let rays = Rays::of_photo(&photo, &depth_m, &self.working.camera, WHITE, count, stream);
        // The camera is the believed one already; depth is true and only has to follow the room's scale.
        varied_rays(rays, &Variation::NONE, self.scale, self.seen.cube)
    }
}

/// e^median of log(a / b) where both are known.
fn median_ratio(a: &DepthMap, b: &DepthMap) -> f32 {
    let b = lo_imaging::resize_depth(b, a.width(), a.height());
    let known = a.pixels().iter().zip(b.pixels()).filter(|(a, b)| **a > 0.0 && **b > 0.0);
    let mut ratios: Vec<f32> = known.map(|(a, b)| a / b).filter(|ratio| ratio.is_finite()).collect();
    if ratios.is_empty() {
        return 1.0;
    }
    let middle = ratios.len() / 2;
    *ratios.select_nth_unstable_by(middle, f32::total_cmp).1
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use lo_dataset::{Generator, GeneratorConfig};
    use lo_synth::SynthConfig;

    use super::*;

    fn sample() -> Sample {
        sample_for(6)
    }

    /// With points for octrees of this depth.
    fn sample_for(octree_depth: u32) -> Sample {
        let room = SynthConfig { crop_size: [120, 80], ..SynthConfig::default() };
        let config =
            GeneratorConfig { room, shots: 1, panoramas: 2, panorama_height: 32, octree_depth, ..Default::default() };
        Generator::new(3, config).unwrap().record(1).unwrap().sample(0)
    }

    fn median(mut values: Vec<f32>) -> f32 {
        values.sort_by(f32::total_cmp);
        values[values.len() / 2]
    }

    #[test]
    fn photo_panoramas_and_true_octree_agree_however_the_sample_is_varied() {
        let sample = sample();
        let network = LightNetConfig { depth: 6, ..LightNetConfig::default() };
        let wrong = Variation { mirrored: true, gains: [1.3, 1.0, 1.1], focal: 1.15, zoom: 1.1 };
        let doubled = sample.depth_m.as_ref().unwrap().map(|z| 2.0 * z);
        let doubled_turned = wrong.depth(&doubled);
        let cases = [
            (Variation::NONE, KnownDepth::True, 1.0),
            (wrong, KnownDepth::True, 1.0),
            (wrong, KnownDepth::Predicted(&doubled_turned), 2.0),
        ];
        for (variation, depth, scale) in cases {
            let rays = RayCounts { novel: 2000, visible: 2000 };
            let mut stream = lo_random::stream(1, "test", 0);
            let example = LightExample::new(&sample, &variation, depth, &network, rays, &mut stream).unwrap();
            let tracer = ConeTracer::new(&example.truth, Settings::default()).unwrap();
            let leaf_m = example.truth.cube.node_edge_m(6);
            for (what, rays) in [("photo", &example.visible), ("panoramas", &example.novel)] {
                assert!(rays.len() > 1000, "{what}: {} rays", rays.len());
                let mut seen = vec![lo_cone::ConeSample::default(); rays.len()];
                tracer.trace_batch(&rays.cones, &mut seen);
                let known = || (0..rays.len()).filter(|&i| rays.distance_m[i] > 0.0);
                let off = median(known().map(|i| (seen[i].distance_m - rays.distance_m[i]).abs()).collect());
                // A ray ends in the leaf that holds the surface, up to a leaf before it; with anything mixed up it is metres off.
                assert!(off < leaf_m, "{what} at {variation:?}: {off} m, a leaf has {leaf_m} m");
                // The photo has a tone curve of its own; panoramas have none.
                let limit = if what == "photo" { 0.35 } else { 0.15 };
                let log = |i: usize| (seen[i].radiance[1].ln_1p() - rays.radiance[i][1].ln_1p()).abs();
                let off = median(known().map(log).collect());
                assert!(off < limit, "{what} at {variation:?}: radiance is {off} off");
            }
            let visible_m = median(example.visible.distance_m.clone());
            let truth_m =
                median(sample.depth_m.as_ref().unwrap().pixels().iter().copied().filter(|z| *z > 0.0).collect());
            assert!((0.8..1.6).contains(&(visible_m / truth_m / scale)), "{visible_m} {truth_m}");
        }
    }

    #[test]
    fn the_depth_networks_panorama_shows_what_the_photo_shows() {
        let sample = sample();
        let variation = Variation { mirrored: true, gains: [1.2; 3], focal: 1.2, zoom: 1.1 };
        let example = DepthExample::new(&sample, &variation, 60).unwrap();
        assert_eq!((example.photo.width(), example.photo.height()), (60, 40));
        assert_eq!((example.depth_m.width(), example.depth_m.height()), (60, 40));
        let shown = example.shown();
        let panorama = example.panorama.unwrap();
        let pairs = shown.pixels().iter().zip(panorama.pixels());
        let shown: Vec<(f32, f32)> = pairs.filter(|(s, _)| s[3] > 0.99).map(|(s, p)| (s[1], p[1])).collect();
        assert!(shown.len() > 300, "{} pixels", shown.len());
        let off = median(shown.iter().map(|(a, b)| (a.ln_1p() - b.min(1.0).ln_1p()).abs()).collect());
        assert!(off < 0.1, "{off}");
    }

    #[test]
    fn few_surface_points_make_a_panorama_without_holes() {
        let fine = sample();
        let coarse = sample_for(4);
        assert!(coarse.points.len() < fine.points.len() / 4, "{} {}", coarse.points.len(), fine.points.len());
        let [fine, coarse] = [fine, coarse].map(|sample| true_panorama(&sample, &Variation::NONE).unwrap().unwrap());
        let ratios = coarse.pixels().iter().zip(fine.pixels()).map(|(a, b)| (a[1].ln_1p() - b[1].ln_1p()).abs());
        let off = median(ratios.collect());
        assert!(off < 0.05, "{off}");
        let dark = coarse.pixels().iter().zip(fine.pixels()).filter(|(a, b)| a[1] < 0.5 * b[1]).count();
        assert!(dark < coarse.pixels().len() / 50, "{dark} pixels are dark");
    }
}
