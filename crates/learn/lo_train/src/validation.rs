//! Figures and contact sheet of held-out scenes.

use std::collections::BTreeMap;

use lo_cone::{Cone, ConeSample, OctreeRenderer};
use lo_dataset::{Dataset, NovelView, Sample, Split, indices_of, observed_mask};
use lo_estimate::{DEFAULT_OCTREE_DEPTH, EstimateOptions, Estimator, Input};
use lo_events as events;
use lo_geometry::{Perspective, Quat, Vec3};
use lo_imaging::{Image, Photo, RadianceImage};
use lo_lookup::SceneRenderer;
use lo_metrics::{DepthErrors, LightOnObjects, panorama_psnr_db};
use lo_nets::Networks;
use lo_nets::conv::in_pool;
use lo_nets::light::{Growth, LightNetConfig};
use lo_octree::LightOctree;
use lo_scene::{Completion, Estimate, Frame, LitScene};

use crate::augmentation::Variation;
use crate::example::{AugmentedRoom, DepthExample, DepthSource, UnusableSample};
use crate::learner::Learner;
use crate::rays::panorama_rays;
use crate::report::{LightReport, ValidationReport};
use crate::sheet::{Row, sheet};
use crate::warning::TrainingWarning;

/// Seed of the light network's random choices: the default of estimation.
const SEED: u64 = 0;

/// Held-out crops of panoramas on which the predicted camera is measured, per fully evaluated photo. They are cheap.
const CAMERAS_PER_PHOTO: usize = 4;

/// Held-out photos, with figures that do not depend on the networks.
pub(crate) struct Validation {
    samples: Vec<Sample>,
    /// Photos with known cameras.
    cameras: Vec<(Image<[u8; 3]>, Perspective)>,
    sheet_rows: usize,
    /// Octree depth → PSNR of the true octree and of the shell for each photo.
    bounds: BTreeMap<u32, Vec<[Option<f64>; 2]>>,
}

impl Validation {
    /// Loads the first photos of the dataset's validation part, one per scene; about 12 MB of memory each.
    ///
    /// Predicted cameras are measured on these and on crops of the panoramas. `on_skip` receives skipped samples.
    pub fn new(
        dataset: &dyn Dataset,
        panoramas: &dyn Dataset,
        photos: usize,
        sheet_rows: usize,
        mut on_skip: impl FnMut(TrainingWarning),
    ) -> Self {
        let (mut samples, mut last) = (Vec::new(), String::new());
        for index in 0..dataset.len() {
            if samples.len() == photos {
                break;
            }
            let scene = dataset.scene_id(index);
            if scene == last || dataset.split(index) != Split::Validation {
                continue;
            }
            last = scene.into_owned();
            match dataset.get(index) {
                Ok(sample) if sample.depth_m.is_some() && !sample.points.is_empty() => {
                    samples.push(Sample { radiance: None, normal: None, albedo: None, sensor_depth_m: None, ..sample });
                }
                Ok(sample) => {
                    let error = UnusableSample::Missing("true depth or surface points").to_string();
                    on_skip(TrainingWarning::SampleSkipped { sample: sample.id, error });
                }
                Err(error) => {
                    on_skip(TrainingWarning::SampleSkipped { sample: last.clone(), error: error.to_string() })
                }
            }
        }
        let camera = |sample: &Sample| {
            let perspective = Perspective { up: sample.up?, half_extent: sample.camera.half_extent() };
            Some((sample.photo.clone(), perspective))
        };
        let of_panoramas = indices_of(panoramas, Some(Split::Validation), Some(CAMERAS_PER_PHOTO * photos));
        let of_panoramas = of_panoramas.into_iter().filter_map(|index| camera(&panoramas.get(index).ok()?));
        let cameras = samples.iter().filter_map(camera).chain(of_panoramas).collect();
        Self { samples, cameras, sheet_rows, bounds: BTreeMap::new() }
    }

    /// Measures the exported weights and returns the report and the contact sheet, if it has rows.
    ///
    /// `with_light` includes the light network.
    pub fn run(&mut self, learner: &Learner, with_light: bool) -> (ValidationReport, Option<Image<[u8; 3]>>) {
        let estimator = Estimator::new(learner.exported());
        let config = estimator.networks().expect("the estimator was created with networks").config.clone();
        let depth = config.depth.max(DEFAULT_OCTREE_DEPTH);
        if with_light && !self.bounds.contains_key(&depth) {
            let bounds = self.samples.iter().map(|sample| in_pool(|| bounds(sample, &config, depth)));
            self.bounds.insert(depth, bounds.collect());
        }
        let (mut figures, mut rows) = (FigureAccumulator::default(), Vec::new());
        for sample in &self.samples {
            let row = in_pool(|| evaluate(&estimator, sample, with_light, &mut figures));
            rows.extend(row.filter(|_| rows.len() < self.sheet_rows));
        }
        let mut report = figures.report(self.samples.len());
        let networks = estimator.networks().expect("the estimator was created with networks");
        let camera_errors = |(photo, truth): &(Image<[u8; 3]>, Perspective)| {
            let found = networks.perspective(photo, None)?.camera;
            let fov_deg = |camera: &Perspective| 2.0 * camera.half_extent.atan().to_degrees();
            let up_deg = f64::from(found.up.angle_between(truth.up).to_degrees());
            Some((up_deg, (fov_deg(&found) - fov_deg(truth)).abs()))
        };
        let (up_deg, fov_deg): (Vec<f64>, Vec<f64>) = self.cameras.iter().filter_map(camera_errors).unzip();
        (report.up_error_deg, report.fov_error_deg) = (median(up_deg), median(fov_deg));
        if with_light {
            let bound = |which: usize| mean(self.bounds[&depth].iter().filter_map(|bound| bound[which]));
            (report.true_octree_psnr_db, report.shell_psnr_db) = (bound(0).map(narrow), bound(1).map(narrow));
        }
        (report, (!rows.is_empty()).then(|| sheet(&rows)))
    }
}

/// Figures of each photo; those of panoramas are means over the photo's panoramas.
#[derive(Default)]
struct FigureAccumulator {
    abs_rel: Vec<f64>,
    delta1: Vec<f64>,
    global_db: Vec<f64>,
    db: Vec<f64>,
    alone_db: Vec<f64>,
    splits: Vec<f64>,
    /// Photo → panorama.
    light: Vec<Vec<LightOnObjects>>,
    global_light: Vec<Vec<LightOnObjects>>,
}

impl FigureAccumulator {
    fn report(&self, photos: usize) -> ValidationReport {
        let of = |values: &[f64]| mean(values.iter().copied()).map(narrow);
        ValidationReport {
            photos,
            depth_abs_rel: of(&self.abs_rel),
            depth_delta1: of(&self.delta1),
            global_psnr_db: of(&self.global_db),
            psnr_db: of(&self.db),
            photo_alone_psnr_db: of(&self.alone_db),
            split_accuracy: of(&self.splits),
            light_on_objects: light_report(&self.light),
            global_light_on_objects: light_report(&self.global_light),
            ..ValidationReport::default()
        }
    }
}

/// Summarises the figures of all photos; `None` without any panorama.
fn light_report(photos: &[Vec<LightOnObjects>]) -> Option<LightReport> {
    type Select = fn(&LightOnObjects) -> Option<f64>;
    let by_photo = |figure: Select| -> Vec<f64> {
        photos.iter().filter_map(|panoramas| mean(panoramas.iter().filter_map(figure))).collect()
    };
    let median = |figure: Select| median(by_photo(figure));
    let average = |figure: Select| mean(by_photo(figure).into_iter()).map(narrow);
    photos.iter().any(|panoramas| !panoramas.is_empty()).then(|| LightReport {
        contrast_stops: median(|light| Some(light.contrast_stops)),
        true_contrast_stops: median(|light| Some(light.true_contrast_stops)),
        vector_deg: median(|light| light.vector_deg),
        level_log2: median(|light| Some(light.level_log2)),
        unseen_irradiance_relative_si_rmse: average(|light| light.unseen_relative_si_rmse),
        unseen_irradiance_angular_deg: average(|light| light.unseen_angular_deg),
    })
}

fn mean(values: impl Iterator<Item = f64>) -> Option<f64> {
    let (sum, count) = values.fold((0.0, 0), |(sum, count), value| (sum + value, count + 1));
    (count > 0).then(|| sum / f64::from(count))
}

fn median(mut values: Vec<f64>) -> Option<f32> {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied().map(narrow)
}

fn narrow(figure: f64) -> f32 {
    figure as f32
}

/// Adds the figures of one photo and returns its row of the sheet; `None` if an estimate fails.
///
/// All figures but split accuracy come from full estimates by [`Estimator::estimate`], including working resolution
/// and refinement below the network's depth.
fn evaluate(estimator: &Estimator, sample: &Sample, with_light: bool, figures: &mut FigureAccumulator) -> Option<Row> {
    let networks = estimator.networks()?;
    let true_m = sample.depth_m.as_ref()?;
    let photo = || Photo::Srgb8(sample.photo.clone());
    let completion = Some(if with_light { Completion::Network } else { Completion::None });
    let options = EstimateOptions { completion, seed: SEED, ..EstimateOptions::default() };
    let estimate = |input: Input| estimator.estimate(input, &options, &mut events::ignore).ok();

    let alone = estimate(Input::Photo { photo: photo(), camera: sample.camera })?;
    if let Some(errors) = DepthErrors::compare(true_m, &alone.frame.depth_m) {
        figures.abs_rel.push(errors.abs_rel);
        figures.delta1.push(errors.delta[0]);
    }
    let example = DepthExample::new(sample, &Variation::NONE, networks.depth.longer_side()).ok()?;
    let global_panorama = networks.single_map(&sample.photo);
    if let Some(true_panorama) = &example.panorama {
        figures.global_db.extend(panorama_psnr_db(true_panorama, &global_panorama));
        let (position_m, rotation) = (Vec3::ZERO, Quat::IDENTITY);
        let at_camera = NovelView { position_m, rotation, radiance: true_panorama.clone(), depth_m: None };
        figures.global_light.push(light_on_objects(sample, &at_camera, &global_panorama).into_iter().collect());
    }
    let unknown = || global_panorama.map(|_| [0.0; 3]);
    let true_panorama = example.panorama.unwrap_or_else(unknown);
    let mut row = Row {
        photo: sample.photo.clone(),
        panoramas: [global_panorama, true_panorama],
        depths_m: [alone.frame.depth_m.clone(), example.depth_m],
        octrees: None,
    };
    if with_light {
        let panoramas = scene_panoramas(&alone, &sample.views);
        figures.alone_db.extend(views_db(&sample.views, &panoramas));
        let lights = sample.views.iter().zip(&panoramas).filter_map(|(view, got)| light_on_objects(sample, view, got));
        figures.light.push(lights.collect());
        let frame = Frame::new(photo(), true_m.clone(), sample.camera, 1.0).ok()?;
        let scene = estimate(Input::MeasuredDepth(frame))?;
        figures.db.extend(scene_db(&scene, &sample.views));
        let room = AugmentedRoom::new(sample, &Variation::NONE, DepthSource::True).ok()?;
        let truth = room.truth(&networks.config).ok()?;
        figures.splits.extend(split_accuracy(networks, sample, &room, &truth));
        if let Some(view) = sample.views.first() {
            let viewers = SceneRenderer::new(&LitScene::as_estimated(scene.clone()));
            let panorama = seen_from(&|eye, cones, samples| viewers.trace_batch(eye, cones, samples), view);
            row.panoramas = [panorama, view.radiance.clone()];
        }
        row.octrees = Some([scene.light, truth]);
    }
    Some(row)
}

/// Returns the share of correct split labels of the light network along the true octree.
fn split_accuracy(networks: &Networks, sample: &Sample, room: &AugmentedRoom, truth: &LightOctree) -> Option<f64> {
    let input = room.input(&networks.config, SEED).ok()?;
    let input = input.with_up(room.seen.room.up).with_map(networks.single_map(&sample.photo));
    let global = networks.depth.global_feature(&networks.depth.network_input(&sample.photo));
    let along = networks.light.forward(&input, Some(global), Growth::Truth(&truth.octree)).ok()?;
    let (mut right, mut all) = (0, 0);
    for (depth, level) in (networks.config.full_depth..).zip(&along.levels) {
        let logits: Vec<f32> = level.logits.clone().into_data().iter().collect();
        let rows = &truth.octree.levels()[depth as usize].rows;
        right += logits.iter().zip(rows).filter(|(logit, row)| (**logit > 0.0) == (**row >= 0)).count();
        all += logits.len();
    }
    Some(right as f64 / all.max(1) as f64)
}

/// Returns the PSNR of panoramas from a photo's true octree, in the cube of its estimate, and from its shell.
fn bounds(sample: &Sample, network: &LightNetConfig, octree_depth: u32) -> [Option<f64>; 2] {
    let Ok(room) = AugmentedRoom::new(sample, &Variation::NONE, DepthSource::True) else { return [None; 2] };
    let network = LightNetConfig { depth: octree_depth, ..network.clone() };
    let truth = room.truth(&network).ok().and_then(|truth| octree_db(&truth, &sample.views));
    let options = EstimateOptions { octree_depth: Some(octree_depth), ..EstimateOptions::default() };
    let options = EstimateOptions { completion: Some(Completion::Shell), ..options };
    let input = Input::MeasuredDepth(room.working);
    let shell = Estimator::without_networks().estimate(input, &options, &mut events::ignore).ok();
    [truth, shell.and_then(|scene| scene_db(&scene, &sample.views))]
}

/// Traces cones from an eye position.
type Trace<'a> = &'a dyn Fn(Vec3, &[Cone], &mut [ConeSample]);

/// Returns the mean PSNR of a scene's panoramas at the positions of the true ones, as in `lo_eval`.
fn scene_db(scene: &Estimate, views: &[NovelView]) -> Option<f64> {
    views_db(views, &scene_panoramas(scene, views))
}

fn scene_panoramas(scene: &Estimate, views: &[NovelView]) -> Vec<RadianceImage> {
    let viewers = SceneRenderer::new(&LitScene::as_estimated(scene.clone()));
    views.iter().map(|view| seen_from(&|eye, cones, samples| viewers.trace_batch(eye, cones, samples), view)).collect()
}

/// Returns the mean PSNR of the panoramas of an octree without the photo's lookup.
fn octree_db(light: &LightOctree, views: &[NovelView]) -> Option<f64> {
    let viewers = OctreeRenderer::new(light);
    let panorama = |view| seen_from(&|eye, cones, samples| viewers.at(eye).trace_batch(cones, samples), view);
    views_db(views, &views.iter().map(panorama).collect::<Vec<_>>())
}

fn views_db(views: &[NovelView], panoramas: &[RadianceImage]) -> Option<f64> {
    mean(views.iter().zip(panoramas).filter_map(|(view, got)| panorama_psnr_db(&view.radiance, got)))
}

/// Compares light on objects; `None` if the true panorama is clipped at white.
fn light_on_objects(sample: &Sample, view: &NovelView, got: &RadianceImage) -> Option<LightOnObjects> {
    if sample.has_clipped_panoramas() {
        return None;
    }
    LightOnObjects::compare(&view.radiance, got, observed_mask(sample, view).as_deref())
}

fn seen_from(trace: Trace<'_>, view: &NovelView) -> RadianceImage {
    let rays = panorama_rays(view);
    let mut samples = vec![ConeSample::default(); rays.len()];
    trace(view.position_m, &rays.cones, &mut samples);
    let pixels = samples.into_iter().map(|sample| sample.radiance).collect();
    RadianceImage::new(view.radiance.width(), view.radiance.height(), pixels)
}
