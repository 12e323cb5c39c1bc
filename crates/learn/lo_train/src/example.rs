//! Training examples, made from samples.

use lo_cone::{ConeTracer, Settings};
use lo_dataset::{NovelView, Sample, TrueLeaves, true_octree};
use lo_estimate::ObservedFrame;
use lo_geometry::{Camera, Cube, Mat3, Perspective, Vec3};
use lo_imaging::{DepthMap, Image, Photo, RadianceImage, linear_from_srgb8, srgb8_from_linear};
use lo_nets::depth::{DepthNet, size_within};
use lo_nets::expected::{ExpectedTruth, PhotoStatistics};
use lo_nets::light::{LightInput, LightNetConfig, Rays};
use lo_octree::LightOctree;
use lo_random::{RngExt, Stream};
use lo_scene::Frame;

use crate::augmentation::{Variation, augmented_rays};
use crate::rays::sample_panorama_rays;

/// Size of the single map.
pub(crate) const PANORAMA: (usize, usize) = (128, 64);

/// Smallest and largest depth of the octree that the true panorama at the camera is rendered from. At the largest,
/// leaves match the panorama's pixels at 4 m.
const PANORAMA_DEPTHS: [u32; 2] = [3, 6];

/// Smallest leaf edge of that octree, in spacings of the surface points. Smaller leaves would leave holes.
const MIN_LEAF_SPACINGS: f32 = 1.25;

/// Largest distance from the camera at which a panorama counts as taken there.
const AT_CAMERA_M: f32 = 0.05;

/// Photo values from which rays of the photo count as clipped, as in [`Frame::clipped`].
const WHITE: f32 = 0.956;

/// Reasons to skip a sample.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum UnusableSample {
    /// Required data is missing.
    #[error("the sample has no {0}")]
    Missing(&'static str),
    /// Photo and depth are inconsistent, or the octree cannot be built.
    #[error("{0}")]
    Invalid(String),
}

pub(crate) fn invalid(reason: impl ToString) -> UnusableSample {
    UnusableSample::Invalid(reason.to_string())
}

/// A training example of the depth network.
#[derive(Debug)]
pub(crate) struct DepthExample {
    pub photo: Image<[u8; 3]>,
    /// True depth of the same size; 0 where unknown.
    pub depth_m: DepthMap,
    /// Camera of the photo.
    pub camera: Camera,
    /// Orientation and field of view of the camera, if known.
    pub perspective: Option<Perspective>,
    /// True panorama at the camera, of size [`PANORAMA`], if known.
    pub panorama: Option<RadianceImage>,
}

impl DepthExample {
    pub fn new(sample: &Sample, variation: &Variation, longer_side: usize) -> Result<Self, UnusableSample> {
        let photo = variation.photo(&sample.photo);
        // A wrong focal length is an augmentation of the light network only.
        let variation = Variation { focal: 1.0, ..*variation };
        let panorama = true_panorama(sample, &variation)?;
        if panorama.is_none() && sample.depth_m.is_none() {
            return Err(UnusableSample::Missing("depth and no panorama at its camera"));
        }
        let depth_m = match &sample.depth_m {
            Some(depth_m) => variation.depth(depth_m),
            None => DepthMap::from_fn(photo.width(), photo.height(), |_, _| 0.0),
        };
        let camera = variation.camera(&sample.camera);
        let perspective = variation.up(sample).map(|up| Perspective { up, half_extent: camera.half_extent() });
        // The aspect ratio of the whole photo, so that photos of one size share a batch however they are cropped.
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

    /// Returns width and height of the photo.
    pub fn size(&self) -> [usize; 2] {
        [self.photo.width(), self.photo.height()]
    }

    /// Projects the photo onto the panorama: premultiplied radiance, coverage.
    pub fn shown(&self) -> Image<[f32; 4]> {
        let linear = self.photo.map(|rgb| rgb.map(linear_from_srgb8));
        lo_imaging::equirectangular_from_perspective(&linear, &self.camera, Mat3::IDENTITY, PANORAMA.0, PANORAMA.1)
    }

    /// Returns the target of the depth network before the logarithm: half the longer side of the
    /// view at each pixel's depth, metres.
    pub fn extent_m(&self) -> DepthMap {
        let extent = self.camera.half_extent() as f32;
        self.depth_m.map(|z| z * extent)
    }
}

/// Returns the true panorama at the camera: one that was taken there, else rendered from surface points, if any.
///
/// A dataset whose panoramas are clipped at white has none: its light is too dark, and its surface points' as well.
pub(crate) fn true_panorama(sample: &Sample, variation: &Variation) -> Result<Option<RadianceImage>, UnusableSample> {
    let (width, height) = PANORAMA;
    if sample.has_clipped_panoramas() {
        return Ok(None);
    }
    let here = |view: &&NovelView| view.position_m.length() < AT_CAMERA_M;
    if let Some(view) = sample.views.iter().find(here) {
        let turned = lo_imaging::rotate_equirectangular(&view.radiance, view.rotation, width, height);
        let column = |x: usize| if variation.mirrored { width - 1 - x } else { x };
        return Ok(Some(Image::from_fn(width, height, |x, y| variation.light(turned[(column(x), y)]))));
    }
    if sample.points.is_empty() {
        return Ok(None);
    }
    let octree = surroundings(sample, variation, PANORAMA_DEPTHS)?;
    let tracer = ConeTracer::new(&octree, Settings::default()).map_err(invalid)?;
    Ok(Some(tracer.panorama(Vec3::ZERO, width, height).radiance))
}

/// Builds the octree of all surface points, of a depth between these: the finest without holes.
pub(crate) fn surroundings(
    sample: &Sample,
    variation: &Variation,
    [coarse, fine]: [u32; 2],
) -> Result<LightOctree, UnusableSample> {
    let points = variation.points(&sample.points);
    let low = points.iter().map(|p| p.position_m).fold(Vec3::ZERO, Vec3::min);
    let high = points.iter().map(|p| p.position_m).fold(Vec3::ZERO, Vec3::max);
    let cube = Cube::centred(0.5 * (low + high), 1.01 * (high - low).max_element());
    let spacing_m = sample.point_area_m2.map_or(0.0, f32::sqrt);
    let closed = |depth: &u32| cube.node_edge_m(*depth) >= MIN_LEAF_SPACINGS * spacing_m;
    let depth = (coarse..=fine).rev().find(closed).unwrap_or(coarse);
    let (octree, _) = LightOctree::from_points(&points, cube, depth, coarse).map_err(invalid)?;
    Ok(octree)
}

/// A training example of the network of expected light.
#[derive(Debug)]
pub(crate) struct ExpectedExample {
    pub statistics: PhotoStatistics,
    pub truth: ExpectedTruth,
}

impl ExpectedExample {
    /// Makes an example with depth predicted by `depth_net`.
    pub fn new(sample: &Sample, variation: &Variation, depth_net: &DepthNet) -> Result<Self, UnusableSample> {
        let example = DepthExample::new(sample, variation, depth_net.longer_side())?;
        let panorama = example.panorama.ok_or(UnusableSample::Missing("panorama at its camera"))?;
        let Perspective { up, .. } = example.perspective.ok_or(UnusableSample::Missing("direction of up"))?;
        let depth_m = depth_net.forward(&[&example.photo]).depth_m(&example.camera);
        let photo = example.photo.map(|rgb| rgb.map(linear_from_srgb8));
        let statistics = PhotoStatistics::new(&photo, &depth_m, &example.camera, up);
        let truth = ExpectedTruth::new(&panorama, &example.camera, &statistics, false);
        Ok(Self { statistics, truth })
    }
}

/// A training example of the light network.
#[derive(Debug)]
pub(crate) struct LightExample {
    /// Input from the visible points, without the single map.
    pub input: LightInput,
    /// Unit vector against gravity.
    pub up: Vec3,
    pub truth: LightOctree,
    /// Rays of novel views.
    pub novel: Rays,
    /// Rays of the photo.
    pub visible: Rays,
}

/// Numbers of rays per step.
#[derive(Clone, Copy, Debug)]
pub(crate) struct RayCounts {
    pub novel: usize,
    pub visible: usize,
}

/// Source of the depth of observed surfaces.
#[derive(Clone, Copy, Debug)]
pub(crate) enum DepthSource<'a> {
    True,
    /// Sensor depth; true depth for samples without it.
    Sensor,
    /// Depth predicted from the augmented photo.
    Predicted(&'a DepthMap),
}

impl LightExample {
    /// Makes an example of an augmented sample.
    pub fn new(
        sample: &Sample,
        variation: &Variation,
        depth: DepthSource,
        network: &LightNetConfig,
        rays: RayCounts,
        stream: &mut Stream,
    ) -> Result<Self, UnusableSample> {
        let room = AugmentedRoom::new(sample, variation, depth)?;
        let input = room.input(network, stream.random())?;
        let truth = room.truth(network)?;
        let novel = sample_panorama_rays(&sample.views, rays.novel, stream);
        let novel = if sample.has_clipped_panoramas() { below_white(&novel) } else { novel };
        let novel = augmented_rays(novel, variation, room.scale, room.seen.cube);
        let visible = room.visible_rays(sample, variation, rays.visible, stream);
        Ok(Self { input, up: room.seen.room.up, truth, novel, visible })
    }
}

/// Returns the rays whose radiance is not clipped.
fn below_white(rays: &Rays) -> Rays {
    let known = (0..rays.len()).filter(|&i| rays.radiance[i].iter().all(|&value| value < WHITE));
    Rays::from_iter(known.map(|i| (rays.cones[i], rays.radiance[i], rays.distance_m[i])))
}

/// An augmented sample's room, as input and target of the light network.
pub(crate) struct AugmentedRoom {
    pub seen: ObservedFrame,
    /// The frame at the working resolution.
    pub working: Frame,
    points: Vec<lo_octree::RadiancePoint>,
    /// Scale of the room relative to the truth, so that its octree fits the predicted depth.
    pub scale: f32,
}

impl AugmentedRoom {
    pub fn new(sample: &Sample, variation: &Variation, depth: DepthSource) -> Result<Self, UnusableSample> {
        if sample.points.is_empty() {
            return Err(UnusableSample::Missing("surface points"));
        }
        let truth = || sample.depth_m.as_ref().ok_or(UnusableSample::Missing("true depth"));
        let (depth_m, scale) = match depth {
            DepthSource::True => (variation.depth(truth()?), 1.0),
            DepthSource::Sensor => match &sample.sensor_depth_m {
                Some(sensor) => (variation.depth(sensor), 1.0),
                None => (variation.depth(truth()?), 1.0),
            },
            DepthSource::Predicted(predicted) => {
                (predicted.clone(), median_ratio(predicted, &variation.depth(truth()?)))
            }
        };
        let photo = Photo::Srgb8(variation.photo(&sample.photo));
        let frame = Frame::new(photo, depth_m, variation.camera(&sample.camera), 1.0).map_err(invalid)?;
        let working = frame.working();
        let seen = ObservedFrame::new(&working, variation.up(sample), None)
            .ok_or(UnusableSample::Missing("depth reading that is not a flying pixel's"))?;
        let mut points = variation.points(&sample.points);
        points.iter_mut().for_each(|point| point.position_m *= scale);
        Ok(Self { seen, working, points, scale })
    }

    /// Returns the light network's input.
    pub fn input(&self, network: &LightNetConfig, seed: u64) -> Result<LightInput, UnusableSample> {
        let ObservedFrame { points, camera, cube, .. } = &self.seen;
        LightInput::new(points, camera, *cube, network, seed).map_err(invalid)
    }

    /// Returns the true octree, the light network's target.
    pub fn truth(&self, network: &LightNetConfig) -> Result<LightOctree, UnusableSample> {
        let ObservedFrame { cube, .. } = self.seen;
        true_octree(&self.points, TrueLeaves::All, cube, network.depth, network.full_depth).map_err(invalid)
    }

    /// Draws rays of the photo.
    fn visible_rays(&self, sample: &Sample, variation: &Variation, count: usize, stream: &mut Stream) -> Rays {
        let Some(depth_m) = &sample.depth_m else { return Rays::from_iter([]) };
        let photo = self.working.radiance();
        let depth_m = lo_imaging::resize_depth(&variation.depth(depth_m), photo.width(), photo.height());
        let rays = Rays::of_photo(&photo, &depth_m, &self.working.camera, WHITE, count, stream);
        // The camera is already augmented; depth is true and needs only the room's scale.
        augmented_rays(rays, &Variation::NONE, self.scale, self.seen.cube)
    }
}

/// Returns the median of a / b over the pixels where both are known; 1 without any.
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

    /// Generates a sample with surface points for octrees of this depth.
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
            (Variation::NONE, DepthSource::True, 1.0),
            (wrong, DepthSource::True, 1.0),
            (wrong, DepthSource::Predicted(&doubled_turned), 2.0),
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
                // A ray ends within a leaf of the surface; in mismatched frames it would be metres off.
                assert!(off < leaf_m, "{what} at {variation:?}: {off} m, a leaf has {leaf_m} m");
                // The photo has a tone curve, panoramas have none.
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
